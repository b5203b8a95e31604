"""The command line: `dyehouse recolor | inspect | demo`.

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
lab(42,55,35 / D65); rgb(r,g,b), linear in the photo's space; or a CSV file of wavelength, reflectance.
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
            command.set_defaults(run=_recolor)
        else:
            command.add_argument("--maps", metavar="DIR", help="write A, B, residual and predicted error there")
            command.add_argument("--force", action="store_true", help="overwrite existing maps")
            command.set_defaults(run=_inspect)
        command.add_argument("--json", action="store_true", help="print one JSON object, for machines")
    demo = commands.add_parser("demo", help="recolor two real photos and write pictures, maps and a contact sheet")
    demo.add_argument("--out", metavar="DIR", default="dyehouse-demo", help="folder to write to (default %(default)s)")
    demo.add_argument("--json", action="store_true", help="print one JSON object, for machines")
    demo.set_defaults(run=_demo)
    return top


def _add_recipe(command: argparse.ArgumentParser) -> None:
    command.add_argument("photo", metavar="PHOTO", help="PNG, JPEG, TIFF, EXR, WebP or camera raw")
    product = command.add_argument_group("the product")
    product.add_argument("--reference", metavar="X,Y", help="matte, lit pixel of the product; or R,G,B linear")
    product.add_argument("--click", metavar="X,Y", help="select the product under this pixel, and find its color")
    product.add_argument("--mask", metavar="FILE", help="mask file, 'alpha', or 'click' (at the reference)")
    product.add_argument("--tolerance", type=float, default=1.0, help="of a clicked region (default 1)")
    product.add_argument("--model", default="auto", help="auto (default), dichromatic or body")
    product.add_argument(
        "--region",
        action="append",
        metavar="'KEY=VALUE ...'",
        help="one of several regions, with "
        "the keys target, reference, click, mask, tolerance, model, residual, meaning, source",
    )
    color = command.add_argument_group("the color")
    color.add_argument("--target", metavar="SWATCH", help="the color it shall have")
    color.add_argument(
        "--meaning",
        choices=("reference", "product"),
        default="reference",
        help="'reference': the reference pixel shall read the target (default). 'product': the product shall have "
        "the target's reflectance, in the light that falls on the reference",
    )
    color.add_argument("--source", metavar="SWATCH", help="the product's present color, for --meaning product")
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
    light.add_argument("--observer", choices=("1931", "1964"), default="1931", help="2 or 10 degrees (default 1931)")
    light.add_argument("--camera", metavar="NAME|CSV", help="sensitivities, for spectra and illuminants")
    light.add_argument("--adaptation", choices=("cat16", "bradford"), default="cat16", help="default cat16")
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


_KEYS = ("target", "reference", "click", "mask", "tolerance", "model", "residual", "meaning", "source")


def recipe_from(options: argparse.Namespace) -> Recipe:
    """Build the recipe that parsed options describe.

    Raises
    ------
    DyehouseError
        If an option cannot be understood.
    """
    from ..core.errors import RecipeError
    from ..core.recipe import Recipe

    common = {key: getattr(options, key) for key in _KEYS}
    if options.region:
        regions = []
        for text in options.region:
            given = _region_options(text)
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


def _region_options(text: str) -> dict[str, str]:
    import shlex

    from ..core.errors import RecipeError

    found: dict[str, str] = {}
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise RecipeError(f"Region '{text}' is not understood ({error}): close the quotes.") from None
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or key not in _KEYS:
            raise RecipeError(f"Region '{text}' has '{word}': give KEY=VALUE with a key of {', '.join(_KEYS)}.")
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
    )


def _open(options: argparse.Namespace) -> tuple[files.Photo, Prepared]:
    from . import files, photo

    recipe = recipe_from(options)
    opened = files.read(options.photo, options.color_space)
    return opened, photo.look(opened, recipe)


def _recolor(options: argparse.Namespace) -> int:
    from ..core.errors import RecipeError
    from . import files, inspection, photo

    if not 1 <= options.quality <= 100:
        raise RecipeError(f"Quality {options.quality} is not in 1..100: 95 is very good.")
    files.check_output(options.output, source=options.photo, force=options.force)
    opened, prepared = _open(options)
    figures = inspection.report(opened, prepared)  # before the photo's pixels are used up
    written, shares = photo.save(
        opened,
        prepared,
        options.output,
        force=options.force,
        quality=options.quality,
        compression=options.compression,
        reuse=True,
    )
    _tell(options, inspection.with_shares(figures, shares) | {"output": str(written)})
    return 0


def _inspect(options: argparse.Namespace) -> int:
    from ..core import gamut
    from ..core.recolor import Shares
    from . import inspection

    opened, prepared = _open(options)
    pixels, outside = 0, 0.0
    for k, analysis in enumerate(prepared.analyses):
        sample = analysis.picture.sample(500_000, analysis.mask)
        matrix = analysis.matrix(prepared.target(k), prepared.target_white, prepared.recipe.regions[k].residual)
        pixels += len(sample)
        outside += float(gamut.out_of_gamut(sample @ matrix.T).sum())
    shares = Shares(pixels, outside / pixels if pixels else 0.0)
    figures = inspection.with_shares(inspection.report(opened, prepared), shares)
    if options.maps:
        figures["maps"] = [str(p) for p in inspection.write_maps(prepared, Path(options.maps), force=options.force)]
    _tell(options, figures)
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
