"""Tables of a catalog: what their rows ask for, and words for whatever is wrong in one."""

import json
import re
from pathlib import Path

import pytest

from dyehouse.batch import tables
from dyehouse.batch.jobs import gather
from dyehouse.core.errors import DyehouseError
from dyehouse.core.recipe import Colorway
from dyehouse.core.swatches import parse_target

NAVY, RED = parse_target("#1F4E79"), parse_target("lab(42, 55, 35)")
SHOE = """\
photo = "shoe.png"
white = "D65"
[[region]]
name = "body"
click = [10, 20]
[[region]]
name = "sole"
mask = "sole.png"
[[colorway]]
name = "navy"
targets = { body = "#1F4E79" }
[[colorway]]
name = "red"
targets = { body = "lab(42, 55, 35)", sole = "#1F4E79" }
[output]
pattern = "{photo}_{colorway}.jpg"
quality = 80
"""


@pytest.fixture
def ask(tmp_path):
    """Write files and gather the last of them; returns (jobs, problems as text)."""

    def call(defaults=None, **texts):
        for name, text in texts.items():
            path = tmp_path / name.replace("__", ".")
            path.write_bytes(text if isinstance(text, bytes) else text.encode())
        jobs, problems = gather([str(path)], defaults and str(tmp_path / defaults))
        return jobs, [str(problem) for problem in problems]

    return call


def test_a_row_is_a_photo_and_a_colorway(ask, tmp_path):
    jobs, problems = ask(t__csv='photo,click,target,colorway\na.png,"10,20",#1F4E79,navy\nb.png,10 20,#fff,\n')
    assert not problems
    first, second = jobs
    assert first.photo == str(tmp_path / "a.png")
    assert first.recipe.regions[0].click == (10, 20) == second.recipe.regions[0].click
    (want,) = first.wants
    assert want.colorway == Colorway("navy", (NAVY,))
    assert want.output == "a-navy.png"
    assert str(want.source).endswith("t.csv', row 2")
    assert second.wants[0].colorway.name == "#fff"


def test_rows_of_one_photo_and_analysis_are_one_job(ask):
    rows = "a.png,1 2,navy=#1F4E79 | red=lab(42 55 35)\nb.png,1 2,navy=#1F4E79\na.png,1 2,grey=#888\na.png,3 4,x=#888"
    jobs, problems = ask(t__csv="photo,click,colorways\n" + rows)
    assert not problems
    assert [[w.colorway.name for w in job.wants] for job in jobs] == [["navy", "red", "grey"], ["navy"], ["x"]]
    assert len({job.sheet for job in jobs}) == 3


def test_a_recipe_fills_what_the_table_leaves_open(ask, tmp_path):
    head = "photo,colorway,output,quality,white,click.body"
    table = head + "\na.png,navy,,,,\nb.png,red,{photo}.png,70,120 90,1 2\nc.png,,,,,\n"
    jobs, problems = ask(defaults="shoe.toml", shoe__toml=SHOE, t__csv=table)
    assert not problems
    a, b, c = jobs
    assert a.recipe.white == "D65"
    assert a.recipe.regions[1].mask == str(tmp_path / "sole.png")
    assert a.wants[0].colorway.targets == (NAVY, None)
    assert (a.wants[0].output, a.wants[0].quality) == ("a_navy.jpg", 80)
    assert (b.recipe.white, b.recipe.regions[0].click) == ((120, 90), (1, 2))
    assert (b.wants[0].output, b.wants[0].quality) == ("b.png", 70)
    assert [w.colorway.name for w in c.wants] == ["navy", "red"]


def test_each_row_may_have_its_own_recipe(ask, tmp_path):
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / "shoe.toml").write_text(SHOE)
    table = "recipe,photo,target.body,target.sole,colorway\nr/shoe.toml,,#1F4E79,keep,x\nr/shoe.toml,a.png,,,red\n"
    jobs, problems = ask(t__csv=table)
    assert not problems
    assert jobs[0].photo == str(tmp_path / "r" / "shoe.png")
    assert jobs[0].recipe.regions[1].mask == str(tmp_path / "r" / "sole.png")
    assert jobs[0].wants[0].colorway == Colorway("x", (NAVY, None))
    assert jobs[1].photo == str(tmp_path / "a.png")


def test_json_lines(ask):
    rows = [
        {"photo": "a.png", "click": [1, 2], "target": "#1F4E79", "colorway": "navy"},
        {"photo": "b.png", "mask": "alpha", "colorways": {"navy": "#1F4E79", "red": "lab(42, 55, 35)"}},
        {"photo": "c.png", "added": [[1, 2]], "target": {"name": "Sea", "rgb": [0.1, 0.2, 0.3]}},
    ]
    jobs, problems = ask(t__jsonl="\n".join(map(json.dumps, rows)))
    assert not problems
    assert jobs[1].wants[1].colorway == Colorway("red", (RED,))
    assert jobs[2].recipe.regions[0].added == ((1, 2),)
    assert jobs[2].wants[0].colorway.targets[0].color.rgb == (0.1, 0.2, 0.3)


def test_json_lines_with_regions(ask):
    row = {"photo": "a.png", "colorways": {"x": {"body": "#1F4E79"}}, "click.body": [3, 4]}
    jobs, problems = ask(defaults="shoe.toml", shoe__toml=SHOE, t__jsonl=json.dumps(row))
    assert not problems
    assert jobs[0].wants[0].colorway == Colorway("x", (NAVY, None))
    assert jobs[0].recipe.regions[0].click == (3, 4)


def test_patterns_of_photos(ask, tmp_path):
    for name in ("b/1.png", "b/2.png", "b/3.jpg", "größe.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "b" / "loop").symlink_to(tmp_path / "b")
    jobs, problems = ask(t__csv="photo,target,output\n**/*.png,#fff,{folder}-{photo}.png\n")
    assert not problems
    assert sorted(job.wants[0].output for job in jobs) == sorted(["b-1.png", "b-2.png", f"{tmp_path.name}-größe.png"])
    assert ask(t__csv="photo,target\nno/*.png,#fff\n")[1] == [
        f"'{tmp_path / 't.csv'}', row 2, column 'photo': no photo matches 'no/*.png': check folder and name."
    ]


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_what_spreadsheets_write(ask, separator, encoding, ends):
    lines = ["photo,click,target", "größe 鞋.png,10 20,#fff", "", ",,", "b.png,1 2,#000", ""]
    jobs, problems = ask(t__csv=ends.join(lines).replace(",", separator).encode(encoding))
    assert not problems
    assert [job.photo.rpartition("/")[2] for job in jobs] == ["größe 鞋.png", "b.png"]
    assert jobs[1].wants[0].source.row == 5


def test_mixed_encodings_name_their_lines(ask):
    jobs, problems = ask(t__csv=b"photo,target\na.png,#fff\ngr\xf6\xdfe.png,#fff\nc.png,#fff\n\xe9.png,#000")
    assert [re.search(r"row (\d+): this is not UTF-8 text: save", p)[1] for p in problems] == ["3", "5"]
    assert len(jobs) == 2


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("", "has no rows"),
        ("photo,target\n", "has no rows"),
        ("foto,target\na,#fff", "row 1, column 'foto': this is not known: did you mean 'photo'"),
        ("photo,photo\na,b", "row 1, column 'photo': there are two columns of this name"),
        ("\n\nfoto,target\na.png,#fff", "row 3, column 'foto': this is not known"),
        ("photo,target\na.png,#fff,3", "row 2: there are 3 cells for 2 columns: quote"),
        ("photo,target\na.png,snow", "row 2, column 'target': Target 'snow' is not a color"),
        ("photo,target,click\na.png,#fff,10", "row 2, column 'click': click is .10.: write a pixel as two"),
        ("photo,target,click\na.png,#fff,1.5 2", "column 'click': click is"),
        ("photo,target,gray\na.png,#fff,18", "column 'gray': gray is 18: write the reflectance"),
        ("photo,target,tolerance\na.png,#fff,x", "column 'tolerance': tolerance is 'x': write a number"),
        ("photo,target,model\na.png,#fff,bodi", "column 'model': model is 'bodi'.*did you mean 'body'"),
        ("photo,target,white\na.png,#fff,moon", "column 'white': .*moon"),
        ("photo,target,quality\na.png,#fff,0", "column 'quality': quality is 0: write 1 to 100"),
        ("photo,target,output\na.png,#fff,{x}.png", "column 'output': pattern is"),
        ("photo,target,output\na.png,#fff,a.bmp", "'a.bmp' does not end in a known extension"),
        ("photo,target,output\na.png,#fff,../a.png", "'../a.png' lies outside the output folder"),
        ("photo,target,output\na.png,#fff,/tmp/a.png", "lies outside the output folder"),
        ("photo,target,output\na.png,#fff,C:/a.png", "lies outside the output folder"),
        ("photo,target,output\na.png,#fff,..\\a.png", "lies outside the output folder"),
        ("photo,target,output\na.png,#fff,sheets/a.png", "folder of the run's own"),
        ("photo,target,output\na.png,#fff,.dyehouse-1.png", "looks like an unfinished file"),
        (f"photo,target,output\na.png,#fff,{'x' * 300}.png", "more than 255 bytes: shorten"),
        ("photo,target,output\na.png,#fff,a.png\nb.png,#fff,./a.png", "row 3, column 'output': .*'a.png' is also the"),
        ("photo,target,output\na.png,#fff,x//a.png\nb.png,#fff,x\\a.png", "row 3, .*'x/a.png' is also the output of"),
        ("photo,target,output\na.png,#fff,a.png\nb.png,#fff,A.png/b.png", "'A.png/b.png' would be a file and a folder"),
        ("photo,target,output\na.png,#fff,x.png/a.png\nb.png,#fff,x.png", "row 3, .* would be a file and a folder"),
        ("photo,target,output,compression\na.png,#fff,a.png,zip", "column 'compression': 'a.png' takes no compression"),
        ("photo\na.png", "row 2, column 'target': there is no color"),
        ("target\n#fff", "row 2: no photo is named"),
        ("photo,colorway\na.png,navy", "column 'colorway': colorway 'navy' is not in the recipe"),
        ("photo,colorways\na.png,navy", "column 'colorways': colorway 'navy' is not in the recipe"),
        ("photo,colorways,target\na.png,x=#fff,#fff", "given beside a colorway or target"),
        ("photo,target.body\na.png,#fff", "column 'target.body': the recipe has no region 'body'"),
        ("photo,target,recipe\na.png,#fff,no.toml", "column 'recipe': .*cannot be read"),
        ('photo,target\n"a.png,#fff', "there is no color|not CSV"),
    ],
)
def test_problems_of_csv(ask, table, words):
    _, problems = ask(t__csv=table)
    assert len(problems) == 1, problems
    assert re.search(words, problems[0]), problems[0]
    assert "t.csv" in problems[0]
    assert problems[0].endswith((".", "?"))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("{", "row 1: this is not JSON"),
        ("[1]", "row 1: this is no object"),
        ('{"foto": 1}', "column 'foto': this is not known: did you mean 'photo'"),
        ('{"photo": ["a.png"], "target": "#fff"}', "column 'photo': photo is .* write a text in quotes"),
        (r'{"photo": "a\u0000.png", "target": "#fff"}', "column 'photo': .* which no file can be called"),
        (r'{"photo": "\ud800.png", "target": "#fff"}', "column 'photo': .* which no file can be called"),
        (r'{"photo": "a.png", "target": "#fff", "colorway": "\ud800"}', "is a name that no file can have"),
        ('{"photo": "a.png", "target": "#fff", "colorway": ["x"]}', "column 'colorway': .* is no name"),
        ('{"photo": "a.png", "recipe": {}}', "column 'recipe': recipe is {}: write a text in quotes"),
        ('{"photo": "a.png", "colorways": [["x", "#fff"]]}', "column 'colorways': .* is no name: write names"),
        ('{"photo": "a.png", "target": 3}', "column 'target': target is 3"),
        ('{"photo": "a.png", "colorways": 3}', "column 'colorways': write names"),
        ('{"photo": "a.png", "target": "#fff", "click": "10,20"}', "column 'click': click is '10,20'"),
    ],
)
def test_problems_of_json_lines(ask, line, words):
    _, problems = ask(t__jsonl=line)
    assert len(problems) == 1, problems
    assert re.search(words, problems[0]), problems[0]


def test_line_ends_of_text_are_no_ends_of_rows(ask):
    text = "photo,target,colorway\r\na.png,#fff,one\u2028two\x85three\r\nb.png,#fff,four\r\n"
    for encoding in ("utf-8", "utf-16"):
        jobs, problems = ask(t__csv=text.encode(encoding))
        assert not problems
        assert [job.wants[0].colorway.name for job in jobs] == ["one\u2028two\x85three", "four"]


def test_tables_whose_columns_cannot_be_read(ask):
    (said,) = ask(t__csv="photo,target\na.png,#fff\n".encode("utf-16-le"))[1]
    assert "t.csv': this is UTF-16 without a byte order mark: save the table again" in said
    (said,) = ask(t__csv=b"f\xf6to,target\na.png,#fff\nb.png,#fff\n")[1]
    assert "t.csv', row 1: this is not UTF-8 text" in said


def test_names_from_urls_are_without_their_queries(ask):
    jobs, problems = ask(t__csv="photo,target\nhttps://x.y/a/shoe.jpg?width=1.5&v=2,#fff\n")
    assert not problems
    assert jobs[0].wants[0].output == "shoe-#fff.png"


def test_every_problem_is_told(ask):
    rows = ["a.png,#fff,1 2", "b.png,snow,1", "c.png,snow,1", "a.png,#fff,3 4"]
    jobs, problems = ask(t__csv="photo,target,click\n" + "\n".join(rows))
    found = [re.search(r"row (\d)(, column '(\w+)')?", problem).group(1, 3) for problem in problems]
    assert found == [("3", "click"), ("4", "click"), ("5", None)]
    assert "'a-#fff.png' is also the output of" in problems[-1]
    assert len(jobs) == 1


@pytest.mark.parametrize(("one", "other"), [("a.png", "A.png"), ("é.png", "e\u0301.png")])
def test_outputs_that_only_some_systems_tell_apart(ask, one, other):
    _, problems = ask(t__csv=f"photo,target\n{one},#fff\n{other},#fff\n")
    assert len(problems) == 1
    assert "is also the output of" in problems[0]


def test_bad_recipes_and_other_files(ask, tmp_path):
    assert "did you mean 'click'" in ask(r__toml="[[region]]\nclik = 3\nfoo = 4")[1][0]
    assert len(ask(r__toml="[[region]]\nclik = 3\nfoo = 4")[1]) == 2
    assert "neither a colorway nor a target" in ask(r__toml="photo = 'a.png'")[1][0]
    assert "neither a recipe nor a table" in ask(r__txt="x")[1][0]
    assert "cannot be read" in str(gather([str(tmp_path / "no.csv")])[1][0])
    assert "No file matches" in str(gather([str(tmp_path / "no*.csv")])[1][0])
    assert "copy it here" in str(gather(["s3://shop/catalog.csv"])[1][0])


def test_a_large_table_is_checked_row_by_row(ask):
    row = '"photos/{k}.png","{x},20",navy,#1F4E79,0.18'
    rows = [row.format(k=k // 2, x=k % 2) for k in range(100_000)]
    rows[7_777] = "a.png,1 2,x,snow,1"
    _, problems = ask(t__csv="photo,click,colorway,target,gray\n" + "\n".join(rows))
    # Two rows of a photo, alike but for the click, would go into one file.
    assert len(problems) == 50_000
    assert sum("Target 'snow'" in problem for problem in problems) == 1


def test_a_table_that_is_a_folder(tmp_path):
    (tmp_path / "x.csv").mkdir()
    _, problems = gather([str(tmp_path / "x.csv")])
    assert "cannot be read" in str(problems[0])
    assert not isinstance(problems[0], DyehouseError)


def test_a_measured_light_is_relative_to_its_table_and_an_input(ask, tmp_path):
    lamp = "".join(f"{nm}, {nm / 500}\n" for nm in range(380, 781, 10))
    rows = (
        "photo,click,target,white,illuminant\na.png,10 20,#fff,lamp.csv,0.5 A + 0.5 D65\nb.png,10 20,#fff,gone.csv,A\n"
    )
    jobs, problems = ask(lamp__csv=lamp, t__csv=rows)
    assert jobs[0].recipe.white == str(tmp_path / "lamp.csv")
    assert jobs[0].recipe.illuminant == "0.5 A + 0.5 D65"
    assert jobs[0].inputs == [str(tmp_path / "a.png"), str(tmp_path / "lamp.csv")]
    assert len(problems) == 1
    assert re.search(r"row 3, column 'white'.*gone\.csv.*cannot be read", problems[0]), problems


def test_the_page_names_every_key():
    page = (Path(tables.__file__).parents[1] / "docs" / "catalog.md").read_text()
    keys = {*tables._KEYS, "format", "name", "targets", "pattern"}
    assert not {key for key in keys if f"`{key}`" not in page}
