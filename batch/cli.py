"""The command line: `dyehouse recolor | inspect | batch | verify | swatches | demo`.

Blender serves the same parser as `blender --command dyehouse`. Numpy and everything heavier is imported inside the
commands, so that `--help` is instant.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..core.recipe import Prepared, Recipe
    from . import files

_EXAMPLES = """\
examples:
  One click on the product, one target color:
    dyehouse recolor shirt.jpg --click 640,820 --target "#1F4E79" -o navy.jpg
  A measured Lab color, a white card in the photo, a mask of your own:
    dyehouse recolor mug.tif --reference 812,640 --mask mug.png --white 120,90 --target "lab(42, 55, 35)" -o red.tif
  A dye's reflectance spectrum, under another light:
    dyehouse recolor sofa.exr --click 300,220 --white D65 --illuminant A --target teal.csv -o evening.exr
  Two materials at once:
    dyehouse recolor shoe.png -o out.png --region "click=410,300 target=#222222" --region "click=200,520 target=#EEE0C0"
  Look before you leap:
    dyehouse inspect shirt.jpg --click 640,820 --target "#1F4E79" --maps maps/

Colors: #RRGGBB, lab(L,a,b), lch(L,C,h), xyz(X,Y,Z), xyy(x,y,Y), each with its white if need be, as in
lab(42,55,35 / D65); rgb(r,g,b), linear in the photo's space; a CSV file of wavelength, reflectance;
or a swatch of a file or a built-in library, as season.ase#Navy or CSS#teal.
Pixels are x,y from the top left."""


def parser() -> argparse.ArgumentParser:
    """Build the command line's parser."""
    top = argparse.ArgumentParser(
        prog="dyehouse",
        description="Put a product into any color, accurately, from one photo.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    top.add_argument("--version", action=_ShowVersion, nargs=0, help="show the version and exit")
    commands = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, help_text in (
        ("recolor", "write the photo with the product in another color"),
        ("inspect", "say what a recolor would do, without writing a picture"),
    ):
        command = commands.add_parser(
            name, help=help_text, epilog=_EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        _add_recipe(command)
        if name == "recolor":
            command.add_argument("-o", "--output", metavar="FILE", required=True, help="file to write")
            command.add_argument("--force", action="store_true", help="overwrite an existing output")
            command.add_argument("--quality", type=int, default=95, help="of JPEG and WebP, 1..100 (default 95)")
            command.add_argument("--compression", help="of TIFF and EXR, such as zip or none (default: the photo's)")
            command.add_argument(
                "--output-space",
                metavar="NAME",
                help="of the output, if not the photo's own: display-p3, rec2020, acescg, ...",
            )
            command.add_argument("--no-verify", action="store_true", help="do not check the color of the written file")
            command.set_defaults(run=_recolor)
        else:
            command.add_argument("--maps", metavar="DIR", help="write A, B, residual and predicted error there")
            command.add_argument("--force", action="store_true", help="overwrite existing maps")
            command.set_defaults(run=_inspect)
        command.add_argument("--json", action="store_true", help="print one JSON object, for machines")
    _add_batch(commands)
    _add_verify(commands)
    _add_swatches(commands)
    demo = commands.add_parser("demo", help="recolor two real photos and write pictures, maps and a contact sheet")
    demo.add_argument("--out", metavar="DIR", default="dyehouse-demo", help="folder to write to (default %(default)s)")
    demo.add_argument("--json", action="store_true", help="print one JSON object, for machines")
    demo.set_defaults(run=_demo)
    return top


def _add_batch(commands: Any) -> None:
    command = commands.add_parser("batch", help="put a catalog of photos into their colorways")
    command.add_argument(
        "tables", metavar="RECIPE_OR_TABLE", nargs="+", help="recipes (.toml) and tables (.csv, .tsv, .jsonl)"
    )
    command.add_argument("--out", metavar="DIR", required=True, help="output folder, or URL such as s3://bucket/folder")
    command.add_argument("--recipe", metavar="FILE", help="recipe for what the tables leave open")
    command.add_argument("--check", action="store_true", help="only say what is wrong, all of it, and write nothing")
    command.add_argument("--resume", action="store_true", help="do only what is missing or has changed")
    command.add_argument("--force", action="store_true", help="make everything anew over an earlier run")
    command.add_argument(
        "--workers", type=int, metavar="N", help="processes on this machine (default one per core; 0: this one)"
    )
    command.add_argument("--scheduler", metavar="ADDRESS", help="dask.distributed scheduler, such as tcp://host:8786")
    command.add_argument(
        "--per-task", type=int, default=1, metavar="N", help="photos a worker takes at once (default 1)"
    )
    command.add_argument("--max-error", type=float, metavar="D", help="set aside what is predicted to be farther off")
    command.add_argument("--allow-warnings", action="store_true", help="do not set aside for warnings alone")
    command.add_argument("--no-sheets", action="store_true", help="no contact sheets and no page")
    command.add_argument("--no-verify", action="store_true", help="do not check the color of the written files")
    command.add_argument("--journal", metavar="FILE", help="the run's journal (default: in the output folder)")
    command.add_argument("--quiet", action="store_true", help="print only what went wrong")
    command.add_argument("--json", action="store_true", help="print a JSON object a line, for machines")
    command.set_defaults(run=_batch)


def _add_observer(command: Any) -> None:
    command.add_argument("--observer", choices=("1931", "1964"), default="1931", help="2 or 10 degrees (default 1931)")
    command.add_argument("--camera", metavar="NAME|CSV", help="sensitivities, for spectra and illuminants")
    command.add_argument("--adaptation", choices=("cat16", "bradford"), default="cat16", help="default cat16")


def _add_verify(commands: Any) -> None:
    command = commands.add_parser("verify", help="compare a picture's color at a pixel with the asked one")
    command.add_argument("photo", metavar="IMAGE", help="the picture to look at")
    command.add_argument("--reference", metavar="X,Y", required=True, help="matte pixel of the product")
    command.add_argument("--target", metavar="SWATCH", required=True, help="the color that was asked for")
    command.add_argument("--within", type=float, metavar="D", help="exit with 1 if it is farther than D CIEDE2000")
    command.add_argument("--illuminant", metavar="LIGHT", help="light on the product, for a spectrum")
    _add_observer(command)
    command.add_argument("--color-space", metavar="NAME", help="the picture's, if the file does not say")
    command.add_argument("--json", action="store_true", help="print one JSON object, for machines")
    command.set_defaults(run=_verify)


def _add_swatches(commands: Any) -> None:
    command = commands.add_parser("swatches", help="list, search and convert swatch files; colors under other lights")
    command.add_argument(
        "place", metavar="LIBRARY", nargs="?", help="swatch file, folder or built-in library, or one swatch of it as "
        "LIBRARY#NAME; without it the built-in libraries are listed"
    )  # fmt: skip
    command.add_argument("--search", metavar="WORDS", default="", help="only those with these words in their names")
    command.add_argument("--nearest", metavar="SWATCH", help="the nearest to this color first, by CIEDE2000")
    command.add_argument("--count", type=int, metavar="N", help="at most so many (of the nearest: 10)")
    command.add_argument("--under", metavar="LIGHTS", help="how spectra look under these lights, as D65,A,FL11")
    command.add_argument("--against", metavar="SWATCH", help="metamerism index of spectra against this spectrum")
    command.add_argument("--cmyk", metavar="PROFILE", help="ICC profile of the inks; or 'plain', roughly without one")
    command.add_argument("-o", "--output", metavar="FILE", help="write them as .ase, .aco, .gpl, .cxf, .csv or .txt")
    command.add_argument("--force", action="store_true", help="overwrite an existing file")
    command.add_argument("--json", action="store_true", help="print one JSON object, for machines")
    command.set_defaults(run=_swatches)


def _add_recipe(command: argparse.ArgumentParser) -> None:
    command.add_argument("photo", metavar="PHOTO", help="PNG, JPEG, TIFF, EXR, WebP or camera raw")
    command.add_argument(
        "--recipe", metavar="FILE", help="recipe file, instead of the options for product, color, light"
    )
    command.add_argument("--colorway", metavar="NAME", help="of the recipe file")
    product = command.add_argument_group("the product")
    product.add_argument("--reference", metavar="X,Y", help="matte, lit pixel of the product; or R,G,B linear")
    product.add_argument("--click", metavar="X,Y", help="select the product under this pixel, and find its color")
    product.add_argument("--mask", metavar="FILE", help="mask file, 'alpha', or 'click' (at the reference)")
    product.add_argument("--tolerance", type=float, default=1.0, help="of a clicked region (default 1)")
    product.add_argument(
        "--model", default="auto", help="auto (default), body, dichromatic, regularized, bounce, lights or metal"
    )
    product.add_argument(
        "--region",
        action="append",
        metavar="'KEY=VALUE ...'",
        help="one of several regions, with "
        "the keys target, reference, click, mask, tolerance, model, residual, meaning, source, spill",
    )
    color = command.add_argument_group("the color")
    color.add_argument("--target", metavar="SWATCH", help="the color it shall have")
    color.add_argument(
        "--meaning",
        choices=("reference", "product"),
        default="reference",
        help="'reference': a matte pixel in the light of the reference shall read the target (default). 'product': "
        "the product shall have the target's reflectance, in the light that falls on the reference",
    )
    color.add_argument("--source", metavar="SWATCH", help="the product's present color, for --meaning product")
    color.add_argument(
        "--spill",
        action="store_true",
        help="recolor what shows of the product outside the mask too: the rim that a mask too tight leaves, and the "
        "light thrown on a neutral surround",
    )
    color.add_argument("--residual", default="fade", help="what the model does not explain: fade (default), keep, drop")
    light = command.add_argument_group("the light")
    light.add_argument(
        "--white",
        metavar="WHITE",
        help="X,Y of a white card; R,G,B linear; an illuminant (D65, A, "
        "FL11, LED-B3) or temperature (3200K); or 'highlights'. Default: the photo is balanced",
    )
    light.add_argument("--gray", type=float, default=1.0, help="reflectance of the card (default 1; grey card 0.18)")
    light.add_argument("--illuminant", metavar="LIGHT", help="new light: a name, a temperature, or R,G,B")
    _add_observer(light)
    command.add_argument(
        "--color-space",
        metavar="NAME",
        help="the photo's, if the file does not say or is wrong: srgb, display-p3, adobe-rgb, linear-srgb, ...",
    )


class _ShowVersion(argparse.Action):
    """Look the version up only when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import PackageNotFoundError, version

        try:
            print("dyehouse", version("dyehouse"))
        except PackageNotFoundError:  # run from Blender, where it is an extension and not a distribution
            print("dyehouse (extension)")
        parser.exit()


def _numbers(text: str, what: str, counts: tuple[int, ...]) -> tuple[float, ...]:
    from ..core.errors import RecipeError

    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) not in counts or not all(math.isfinite(v) for v in values):
        forms = " or ".join({2: "x,y", 3: "r,g,b"}[n] for n in counts)
        raise RecipeError(
            f"{what} '{text}' is not understood: give {forms}, such as {'640,480' if 2 in counts else '1,1,1'}."
        )
    return values


def _pixel(text: str | None, what: str) -> tuple[int, int] | None:
    if text is None:
        return None
    x, y = _numbers(text, what, (2,))
    return math.floor(x), math.floor(y)


def _light(text: str | None) -> str | tuple[float, ...] | None:
    """A light: numbers if it begins like one and has commas, else a name."""
    if text is None or "," not in text:
        return text
    return _numbers(text, "White", (2, 3))


REGION_KEYS = ("target", "reference", "click", "mask", "tolerance", "model", "residual", "meaning", "source", "spill")


def recipe_from(options: argparse.Namespace) -> Recipe:
    """Build the recipe that parsed options describe.

    Raises
    ------
    DyehouseError
        If an option cannot be understood.
    """
    from ..core.errors import RecipeError
    from ..core.recipe import Recipe

    common = {key: getattr(options, key) for key in REGION_KEYS}
    if options.region:
        regions = []
        for text in options.region:
            given = region_options(text)
            regions.append(_region({**common, **given}))
    else:
        regions = [_region(common)]
    illuminant = _light(options.illuminant)
    if isinstance(illuminant, tuple) and len(illuminant) != 3:
        raise RecipeError(f"Illuminant '{options.illuminant}' is not understood: give a name or r,g,b.")
    return Recipe(
        regions=tuple(regions),
        white=_light(options.white),
        gray=options.gray,
        illuminant=illuminant,
        observer=options.observer,
        camera=options.camera,
        adaptation=options.adaptation,
    )


def region_options(text: str) -> dict[str, str]:
    """Read one region of the form ``KEY=VALUE ...``.

    Raises
    ------
    RecipeError
        If it has another form or an unknown key.
    """
    import shlex

    from ..core.errors import RecipeError

    found: dict[str, str] = {}
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise RecipeError(f"Region '{text}' is not understood ({error}): close the quotes.") from None
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or key not in REGION_KEYS:
            raise RecipeError(f"Region '{text}' has '{word}': give KEY=VALUE with a key of {', '.join(REGION_KEYS)}.")
        found[key] = value
    return found


def _region(given: dict):
    from ..core.errors import RecipeError
    from ..core.recipe import Region
    from ..core.swatches import parse_target

    try:
        tolerance = float(given["tolerance"])
    except ValueError:
        raise RecipeError(f"Tolerance '{given['tolerance']}' is not a number: 1 is ordinary.") from None
    if given["spill"] not in (True, False, "yes", "no"):
        raise RecipeError(f"Spill '{given['spill']}' is not understood: write spill=yes or spill=no.")
    residual: str | float = given["residual"]
    if isinstance(residual, str):
        with contextlib.suppress(ValueError):  # a word is checked where it is used
            residual = float(residual)
    reference = given["reference"]
    return Region(
        target=parse_target(given["target"]) if given["target"] else None,
        reference=None if reference in (None, "auto") else _numbers(reference, "Reference", (2, 3)),
        mask=given["mask"],
        click=_pixel(given["click"], "Click"),
        tolerance=tolerance,
        meaning=given["meaning"],
        source=parse_target(given["source"]) if given["source"] else None,
        model=given["model"],
        residual=residual,
        spill=given["spill"] in (True, "yes"),
    )


def _open(options: argparse.Namespace) -> tuple[files.Photo, Prepared]:
    from . import files, photo

    recipe, color_space = _asked(options)
    opened = files.read(options.photo, color_space)
    return opened, photo.look(opened, recipe)


def _asked(options: argparse.Namespace) -> tuple[Recipe, str | None]:
    """The recipe, from its file or from the options, and the photo's color space."""
    from ..core.errors import RecipeError
    from ..core.recipe import with_colorway
    from ..core.recipe_file import nearest, read_recipe

    if options.recipe is None:
        if options.colorway is not None:
            raise RecipeError(f"Colorway '{options.colorway}' is one of no recipe: give its file with --recipe.")
        return recipe_from(options), options.color_space
    plain = vars(parser().parse_args([options.command, "photo", *(["-o", "file"] if "output" in options else [])]))
    for name in (*REGION_KEYS, "region", "white", "gray", "illuminant", "observer", "camera", "adaptation"):
        if getattr(options, name) != plain[name]:
            raise RecipeError(f"--{name} and --recipe contradict each other: write it into the recipe file.")
    stored = read_recipe(options.recipe)
    for name in ("quality", "compression", "output_space"):
        if name in options and getattr(options, name) == plain[name]:
            setattr(options, name, getattr(stored.output, name))
    recipe, found = stored.located(), {colorway.name: colorway for colorway in stored.recipe.colorways}
    if options.colorway is not None:
        if options.colorway not in found:
            remedy = nearest(options.colorway, found) if found else "it has none"
            raise RecipeError(f"Colorway '{options.colorway}' is not in '{options.recipe}': {remedy}.")
        recipe = with_colorway(recipe, found[options.colorway])
    elif found and not any(region.target for region in recipe.regions):
        raise RecipeError(f"'{options.recipe}' has several colorways: choose one with --colorway {', '.join(found)}.")
    return replace(recipe, colorways=()), options.color_space or stored.color_space


def _recolor(options: argparse.Namespace) -> int:
    from ..core.colorspace import space_named
    from ..core.errors import RecipeError
    from . import files, inspection, photo, verification

    if not 1 <= options.quality <= 100:
        raise RecipeError(f"Quality {options.quality} is not in 1..100: 95 is very good.")
    files.check_output(options.output, source=options.photo, force=options.force)
    if options.output_space:
        space_named(options.output_space)  # says in words if there is none, before the photo is looked at
    opened, prepared = _open(options)
    opened.wanted = space_named(options.output_space) if options.output_space else None
    figures = inspection.report(opened, prepared)  # before the photo's pixels are used up
    expected = None if options.no_verify else verification.expect(opened, prepared)
    written, shares = photo.save(
        opened,
        prepared,
        options.output,
        force=options.force,
        quality=options.quality,
        compression=options.compression,
        reuse=True,
    )
    del opened, prepared  # the file is read back in their place
    checks = [] if expected is None else [check.as_dict() for check in expected.check(written)]
    _tell(options, inspection.with_shares(figures, shares) | {"output": str(written), "verification": checks})
    return 0


def _inspect(options: argparse.Namespace) -> int:
    from . import inspection

    opened, prepared = _open(options)
    figures = inspection.figures(opened, prepared)
    if options.maps:
        figures["maps"] = [str(p) for p in inspection.write_maps(prepared, Path(options.maps), force=options.force)]
    _tell(options, figures)
    return 0


def _batch(options: argparse.Namespace) -> int:
    from . import catalog

    return catalog.command_line(options)


def _verify(options: argparse.Namespace) -> int:
    from ..core.swatches import parse_target
    from . import verification

    found = verification.verify(
        options.photo,
        _numbers(options.reference, "Reference", (2,)),
        parse_target(options.target),
        color_space=options.color_space,
        illuminant=options.illuminant,
        observer=options.observer,
        camera=options.camera,
        adaptation=options.adaptation,
    )
    print(json.dumps(found.as_dict(), indent=2) if options.json else found.sentence)
    return int(options.within is not None and found.ciede2000 > options.within)


def _swatches(options: argparse.Namespace) -> int:
    from ..core import swatch_files
    from . import swatch_listing

    if options.place is None:
        figures = swatch_listing.libraries()
    else:
        library, away = swatch_listing.choose(
            options.place, options.search, options.nearest, options.count, options.cmyk
        )
        lights = options.under.split(",") if options.under else ()
        figures = swatch_listing.report(library, away, lights, options.against)
        if options.output:
            losses = swatch_files.write(options.output, library, force=options.force)
            figures |= {"losses": losses, "output": options.output}
    print(json.dumps(figures, indent=2) if options.json else swatch_listing.in_words(figures))
    return 0


def _demo(options: argparse.Namespace) -> int:
    from . import demo

    made = demo.run(Path(options.out), quiet=options.json)
    if options.json:
        print(json.dumps(made, indent=2))
    return 0


def _tell(options: argparse.Namespace, figures: dict[str, Any]) -> None:
    from . import inspection

    if options.json:
        print(json.dumps(figures, indent=2))
    else:
        print(inspection.in_words(figures, brief=options.command == "recolor"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns
    -------
    0 when done, 2 for bad input (one sentence on stderr says what and how to mend it).
    """
    options = parser().parse_args(arguments)
    from ..core.errors import DyehouseError

    try:
        return int(options.run(options))
    except DyehouseError as error:
        message = str(error)
    except MemoryError:
        message = f"There is not enough memory for {getattr(options, 'photo', 'this')}: close other programs."
    except KeyboardInterrupt:
        print("dyehouse: stopped", file=sys.stderr)
        return 130
    if getattr(options, "json", False):
        print(json.dumps({"error": message}))
    print(f"dyehouse: {message}", file=sys.stderr)
    return 2
