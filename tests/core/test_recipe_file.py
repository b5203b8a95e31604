"""Recipe files: exact round trips, the same pixels, and words for whatever is wrong in one."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dyehouse.core import Picture
from dyehouse.core.errors import FileError, RecipeError
from dyehouse.core.recipe import ADAPTATIONS, MEANINGS, OBSERVERS, Colorway, Recipe, Region, prepare
from dyehouse.core.recipe_file import (
    Output,
    RecipeFileError,
    StoredRecipe,
    from_toml,
    moved_to,
    read_recipe,
    to_toml,
    write_recipe,
)
from dyehouse.core.recolor import recolor
from dyehouse.core.spectra import Spectrum
from dyehouse.core.swatches import Encoded, Linear, Stimulus, Swatch, parse_target

# --- the round trip -------------------------------------------------------------------------------------------

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
names = texts.filter(bool)
numbers = st.floats(-1e6, 1e6) | st.integers(-1000, 1000)
positive = st.floats(1e-6, 1.0)
triples = st.tuples(*[st.floats(-2, 4)] * 3)
pixels = st.tuples(st.integers(0, 9999), st.integers(0, 9999))
reflectances = st.lists(st.floats(0, 1), min_size=2, max_size=8).map(
    lambda values: Spectrum(np.linspace(400, 700, len(values)), np.array(values))
)
written = st.sampled_from(["#C0392B", "#c32", "lab(42, 55, 35 / D65 10)", "rgb(.1,.2,.3)", "0.5, 0.04, 0.02"])
swatches = st.one_of(
    written.map(parse_target),
    st.builds(
        Swatch,
        texts,
        st.builds(Linear, triples)
        | st.builds(Encoded, triples)
        | st.builds(Stimulus, triples, st.tuples(*[positive] * 3))
        | reflectances,
    ),
    st.tuples(st.tuples(*[st.integers(0, 255)] * 3), names).map(
        lambda made: Swatch.from_srgb(np.array(made[0]) / 255, made[1])
    ),
)
maybe = st.none() | swatches
lights = st.sampled_from(["D65", "A", "3200K", "FL11"]) | st.tuples(*[positive] * 3)
regions = st.builds(
    Region,
    target=maybe,
    reference=st.none() | st.tuples(numbers, numbers) | triples,
    mask=st.none() | names,
    click=st.none() | pixels,
    tolerance=positive,
    meaning=st.sampled_from(MEANINGS),
    source=maybe,
    model=st.sampled_from(["auto", "body", "dichromatic"]),
    residual=st.sampled_from(["fade", "keep", "drop"]) | st.floats(0, 1),
    name=texts,
    added=st.lists(pixels, max_size=2).map(tuple),
    removed=st.lists(pixels, max_size=2).map(tuple),
    spill=st.booleans(),
)


@st.composite
def stored_recipes(draw):
    found = draw(st.lists(regions, min_size=1, max_size=3, unique_by=lambda r: r.name or object()))
    targets = st.tuples(*[maybe] * len(found))
    colorways = draw(st.lists(st.builds(Colorway, names, targets), max_size=3, unique_by=lambda c: c.name))
    recipe = Recipe(
        regions=tuple(found),
        white=draw(st.none() | st.just("highlights") | lights | st.tuples(numbers, numbers)),
        gray=draw(positive),
        illuminant=draw(st.none() | lights),
        observer=draw(st.sampled_from(OBSERVERS)),
        camera=draw(st.none() | st.just("nikon")),
        adaptation=draw(st.sampled_from(ADAPTATIONS)),
        colorways=tuple(colorways),
    )
    output = Output(
        draw(names.filter(lambda n: not set("{}") & set(n))), draw(st.integers(1, 100)), draw(st.none() | names)
    )
    return StoredRecipe(recipe, draw(st.none() | names), draw(st.none() | st.just("display-p3")), output)


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.too_slow])
@given(stored_recipes())
def test_every_recipe_comes_back_exactly(stored):
    text = to_toml(stored)
    again = from_toml(text)
    assert again == stored
    assert to_toml(again) == text


def test_the_strategy_above_knows_every_attribute():
    # A new attribute of Region must be added to it, or its round trip is not tested.
    drawn = {
        "target",
        "reference",
        "mask",
        "click",
        "tolerance",
        "meaning",
        "source",
        "model",
        "residual",
        "name",
        "spill",
    }
    assert {f.name for f in dataclasses.fields(Region)} - drawn - {"added", "removed"} == set()


def test_a_recipe_is_easy_on_the_eyes():
    shirt = Region(name="shirt", click=(640, 820), added=((10, 20),), target=parse_target("#1F4E79"))
    sole = Region(name="the sole", mask="masks/sole.png", tolerance=0.5)
    ways = (
        Colorway("navy", (parse_target("#1F4E79"), None)),
        Colorway("red", (parse_target("lab(42, 55, 35)"), Swatch.from_srgb((1, 1, 1), "Snow"))),
    )
    stored = StoredRecipe(
        Recipe((shirt, sole), white=(120, 90), colorways=ways), "shirt.jpg", output=Output(quality=90)
    )
    assert to_toml(stored) == (
        'format = 1\nphoto = "shirt.jpg"\nwhite = [120, 90]\n\n'
        '[[region]]\ntarget = "#1F4E79"\nclick = [640, 820]\nname = "shirt"\nadded = [[10, 20]]\n\n'
        '[[region]]\nmask = "masks/sole.png"\ntolerance = 0.5\nname = "the sole"\n\n'
        '[[colorway]]\nname = "navy"\ntargets = { shirt = "#1F4E79" }\n\n'
        '[[colorway]]\nname = "red"\ntargets = { shirt = "lab(42, 55, 35)", '
        '"the sole" = { name = "Snow", color = "#FFFFFF" } }\n\n'
        "[output]\nquality = 90\n"
    )


def test_numbers_of_numpy_are_numbers():
    stored = StoredRecipe(Recipe((Region(tolerance=np.float32(0.1), click=(np.int64(3), np.int32(4))),)))
    region = from_toml(to_toml(stored)).recipe.regions[0]
    assert region.tolerance == np.float32(0.1)
    assert region.click == (3, 4)


def test_one_region_takes_one_color():
    stored = from_toml('[[colorway]]\nname = "navy"\ntargets = "#1F4E79"')
    assert stored.recipe.colorways == (Colorway("navy", (parse_target("#1F4E79"),)),)


def test_a_mask_that_is_an_array_has_no_form():
    with pytest.raises(RecipeError, match="mask of region body is an array: save it as a file"):
        to_toml(StoredRecipe(Recipe((Region(mask=np.ones((2, 2)), name="body"),))))


def test_a_name_that_is_no_unicode():
    with pytest.raises(RecipeError, match="is not Unicode text: rename the file"):
        to_toml(StoredRecipe(Recipe(), photo="caf\udce9.png"))


# --- files and paths ------------------------------------------------------------------------------------------


def spectrum_file(path):
    path.write_text("".join(f"{w}, {0.1 + w / 1000}\n" for w in range(400, 701, 20)))
    return path


def test_write_and_read(tmp_path):
    path = tmp_path / "größe 鞋.toml"
    stored = StoredRecipe(Recipe((Region(parse_target("#123"), mask="m.png"),)), "shirt.jpg", folder=tmp_path)
    assert write_recipe(path, stored) == path
    assert read_recipe(path) == stored
    assert read_recipe(path).photo_path == tmp_path / "shirt.jpg"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    with pytest.raises(FileError, match="exists already"):
        write_recipe(path, stored)
    write_recipe(path, dataclasses.replace(stored, photo="other.jpg"), force=True)
    assert read_recipe(path).photo == "other.jpg"


def test_windows_lines_and_a_byte_order_mark(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes("\ufeffphoto = 'a.png'\r\n[[region]]\r\nname = 'x'\r\n".encode())
    assert read_recipe(path).recipe.regions[0].name == "x"


def test_paths_follow_the_file(tmp_path):
    (tmp_path / "recipes").mkdir()
    spectrum_file(tmp_path / "teal.csv")
    camera = tmp_path / "camera.csv"
    camera.write_text("".join(f"{w}, 0.5, 0.4, 0.3\n" for w in range(400, 701, 20)))
    teal = parse_target("teal.csv", tmp_path)
    region = Region(teal, mask="masks/a.png", source=parse_target("#fff"))
    alpha = Region(mask="alpha", name="b")
    (tmp_path / "lamp.csv").write_text("".join(f"{w}, {w}\n" for w in range(400, 701, 20)))
    recipe = Recipe((region, alpha), camera="camera.csv", white="lamp.csv", illuminant="0.5 A + 0.5 D65")
    stored = StoredRecipe(recipe, "photos/a.jpg", folder=tmp_path)
    placed = stored.located()
    assert placed.regions[0].mask == str(tmp_path / "masks" / "a.png")
    assert placed.regions[1].mask == "alpha"
    assert placed.camera == str(camera)
    assert (placed.white, placed.illuminant) == (str(tmp_path / "lamp.csv"), "0.5 A + 0.5 D65")

    written_to = write_recipe(tmp_path / "recipes" / "a.toml", stored)
    again = read_recipe(written_to)
    assert again.photo == "../photos/a.jpg"
    assert again.recipe.regions[0].mask == "../masks/a.png"
    assert again.recipe.regions[0].target == teal  # its numbers: there is no such file from there
    assert again.recipe.regions[0].source.text == "#fff"
    assert (again.folder / again.recipe.camera).resolve() == camera
    assert moved_to(again, tmp_path).photo == "photos/a.jpg"
    url = dataclasses.replace(stored, photo="s3://bucket/a.jpg")
    assert moved_to(url, tmp_path / "recipes").photo == "s3://bucket/a.jpg"


def test_the_same_text_is_the_same_pixels(product, tmp_path):
    scene = product(noise=0.001)
    spectrum_file(tmp_path / "teal.csv")
    for text in ("#1F4E79", "lab(42,55,35 / D65 10)", "0.1 0.2 0.3", "xyy(0.4, 0.33, 0.12)", "teal.csv"):
        recipe = Recipe((Region(parse_target(text, tmp_path), click=scene.matte),), white=(1.0, 1.0, 0.9))
        again = from_toml(to_toml(StoredRecipe(recipe, folder=tmp_path)), tmp_path / "x.toml").recipe
        before, after = (
            recolor(Picture(scene.image), prepare(Picture(scene.image), r).regions()) for r in (recipe, again)
        )
        np.testing.assert_array_equal(before[0], after[0])


@pytest.mark.parametrize("name", ["missing.toml", "."])
def test_unreadable_files(tmp_path, name):
    with pytest.raises(FileError, match="cannot be read"):
        read_recipe(tmp_path / name)


def test_a_file_in_another_encoding(tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes("photo = 'größe.png'".encode("latin-1"))
    with pytest.raises(FileError, match="is not UTF-8 text: save it again"):
        read_recipe(path)


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(FileError, match="could not be written"):
        write_recipe(tmp_path / "no" / "a.toml", StoredRecipe(Recipe()))


# --- what is wrong, in words ----------------------------------------------------------------------------------

BODY = '[[region]]\nname = "body"\n'


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("photo = ", 1, "is not TOML"),
        ("a = 1\na = 2", 2, "is not TOML"),
        ("fotos = 'a'", 1, "fotos is not known: did you mean 'photo'"),
        ("zzz = 'a'", 1, "zzz is not known: use one of"),
        ("[[regions]]", 1, "regions is not known: did you mean 'region'"),
        ("[region]", 1, r"region must be a list of tables: write \[\[region\]\]"),
        ("region = 3", 1, "region must be a list"),
        ("output = 3", 1, "output must be a table"),
        ("format = 2", 1, "format is 2: this Dyehouse reads format 1, so update it"),
        ("photo = 3", 1, "photo is 3: write a text in quotes"),
        ("photo = ''", 1, "photo is '': give the photo's path"),
        ("\n\ncolor_space = 'srgbb'", 3, "color_space: Color space 'srgbb' is not known"),
        ("white = 'moonlight'", 1, "white: .*moonlight"),
        ("white = [1, 2, 3, 4]", 1, r"white is \[1, 2, 3, 4\]: write numbers such as \[120, 90\]"),
        ("white = [true, 2]", 1, "white is"),
        ("white = [nan, 2]", 1, "white is"),
        ("illuminant = [1, 2]", 1, "illuminant is"),
        ("illuminant = 'highlights'", 1, "name the new light"),
        ("gray = 18", 1, "gray is 18: write the reflectance of the card, 0 to 1"),
        ("gray = 'x'", 1, "gray is 'x': write a number"),
        ("observer = '1932'", 1, "observer is '1932', which is not known: did you mean '1931'"),
        ("adaptation = 'cat02'", 1, "adaptation is 'cat02', which is not known: did you mean 'cat16'"),
        ("camera = 'lumix'", 1, "camera: Camera 'lumix' is not known"),
        ("camera = 'lumix.csv'", 1, "camera: .*cannot be read"),
        (BODY + "tolerence = 2", 3, "region 1, tolerence is not known: did you mean 'tolerance'"),
        (BODY + "tolerance = 0", 3, "region 1, tolerance is 0: write a number above zero"),
        (BODY + "tolerance = nan", 3, "tolerance is nan: write a number"),
        (BODY + BODY + "click = [1.5, 2]", 5, r"region 2, click is \[1.5, 2\]: write a pixel as two whole numbers"),
        (BODY + "added = [1, 2]", 3, "added is|write a pixel"),
        (BODY + "added = 1", 3, "added is 1: write a list of pixels"),
        (BODY + "reference = 'x'", 3, "reference is 'x'"),
        (BODY + "mask = 1", 3, "mask is 1: write a text in quotes"),
        (BODY + "meaning = 'referense'", 3, "did you mean 'reference'"),
        (BODY + "model = 'bodi'", 3, "did you mean 'body'"),
        (BODY + "residual = 'most'", 3, "residual is 'most': write fade, keep, drop or a share"),
        (BODY + "residual = 2", 3, "residual is 2"),
        (BODY + "target = 'reddish'", 3, "target: Target 'reddish' is not a color"),
        (BODY + "target = 'missing.csv'", 3, "target: .*cannot be read"),
        (BODY + "target = 3", 3, "target is 3: write a color such as"),
        (BODY + "target = {name = 'x', rgb = [1, 2]}", 3, "target is|write numbers"),
        (BODY + "target = {name = 'x', wavelengths = [400, 500], reflectance = [1]}", 3, "has 2 wavelengths and 1"),
        (BODY + BODY, 4, "region 2, name 'body' is given to an earlier region too: rename"),
        (BODY + "[[colorway]]\ntargets = []", 3, "name is missing: give every colorway a name"),
        (BODY + "[[colorway]]\nname = 'a'\ntargets = {bodi = '#fff'}", 5, "names region 'bodi'.*did you mean 'body'"),
        ("[[colorway]]\nname = 'a'\ntargets = {bodi = '#fff'}", 3, "give the regions names, or write a list"),
        (BODY + "[[colorway]]\nname = 'a'\ntargets = ['#fff', 'keep']", 5, "targets are 2 for 1 regions: give one"),
        (BODY + "[[colorway]]\nname = 'a'\ntargets = ['snow']", 5, "targets: Target 'snow' is not a color"),
        (BODY + "[[colorway]]\nname = 'a'\ntargets = 5", 5, "targets is 5: write a color for each region"),
        (2 * "[[colorway]]\nname = 'a'\ntargets = '#f00'\n", 5, "'a' is given to an earlier colorway"),
        ("[output]\nquality = 101", 2, "quality is 101: write 1 to 100"),
        ("[output]\nquality = 90.5", 2, "quality is 90.5: write a whole number"),
        ("[output]\npattern = ''", 2, "pattern is ''"),
        ("[output]\npattern = '{color}.png'", 2, "pattern is .*no braces but"),
        ("[output]\npatern = 'x'", 2, "patern is not known: did you mean 'pattern'"),
    ],
)  # fmt: skip
def test_problems_name_file_line_key_and_remedy(text, line, words):
    with pytest.raises(RecipeFileError) as caught:
        from_toml(text, Path("shop") / "shirt.toml")
    message = caught.value.problems[0]
    assert "shirt.toml'" in message
    assert re.search(words, message), message
    assert f"line {line}" in message, message
    assert "\n" not in message


def test_all_problems_are_told():
    with pytest.raises(RecipeFileError) as caught:
        from_toml("fotos = 1\ngray = 2\n" + BODY + "model = 'x'\n[output]\nquality = 0")
    assert [re.search(r"line (\d+)", p)[1] for p in caught.value.problems] == ["1", "2", "5", "7"]
    assert "(3 more in this file.)" in str(caught.value)


bits = st.sampled_from(
    ["[[region]]", "[[colorway]]", "\n", "=", "name", "targets", "[", "]", "{", "}", "'a'", "3", ","]
)


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=60) | st.lists(bits).map("".join))
def test_any_text_gives_a_recipe_or_words(text):
    try:
        assert isinstance(from_toml(text), StoredRecipe)
    except RecipeFileError as error:
        said = error.problems
    else:
        return
    for sentence in said:
        assert sentence.endswith(".")
        assert "recipe.toml" in sentence


def test_names_of_results_cannot_hold_a_path():
    output = Output("{folder}/{photo}-{colorway}.png")
    assert output.named("a", "navy", "shop") == "shop/a-navy.png"
    assert output.named("a{colorway}", "../../etc/x", "..") == "unnamed/a{colorway}--..-etc-x.png"
