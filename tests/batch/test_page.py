"""The page of a run, looked at in a real browser without a network."""

import re
import shutil

import numpy as np
import pytest
from PIL import Image

from dyehouse.batch.cli import main
from dyehouse.batch.page import run_page, worst_first
from dyehouse.batch.sheet import GAP

from .catalogs import catalog, journal_of
from .chromium import PROGRAM, Chromium


@pytest.fixture
def out(tmp_path, product, capsys):
    """A run with results done, set aside and failed."""
    table = catalog(tmp_path / "shop", product, 2, size=128)
    table.write_text(table.read_text() + "photos/<b>no&.png,,x=#fff\n")
    folder = tmp_path / "out"
    assert main(["batch", str(table), "--out", str(folder), "--workers", "0"]) == 1
    return folder


def test_the_page_needs_nothing_else(out):
    text = (out / "index.html").read_text()
    assert text.count("data:image/jpeg;base64,") == 2  # one sheet for each photo, once
    assert not re.findall(r"(?:src|href)=[\"'](?:https?:)?//", text)
    assert not re.search(r"@import|<link|<script src", text)
    assert "&lt;b&gt;no&amp;.png" in text
    assert "<b>no&" not in text


def test_the_worst_come_first():
    def entry(output, status, error, warnings=()):
        return {"output": output, "status": status, "predicted_error": {"bound90": error}, "warnings": warnings}

    made = [
        *(entry("a", "done", 1.0), entry("b", "done", 3.0), entry("c", "needs a person", 0.5), entry("d", "done", 1.0)),
        *(entry("e", "done", 1.0, ["x"]), {"output": "f", "status": "failed"}, {"output": "s", "status": "sheet"}),
    ]
    assert worst_first({e["output"]: e for e in made}, [e["output"] for e in made]) == ["f", "c", "b", "e", "a", "d"]


def test_only_the_worst_have_pictures(out):
    from dyehouse.batch.journal import Journal

    journal = Journal(out / "dyehouse-journal.jsonl")
    text = run_page(journal, list(journal), str(out), most=1)
    assert text.count("data:image/jpeg;base64,") == 1
    assert text.count("<article") == 5
    (out / "sheets" / "ball0.jpg").unlink()
    assert run_page(journal, list(journal), str(out)).count("data:image/jpeg;base64,") == 1
    journal.close()


def test_it_tells_what_was_delivered(out):
    text = (out / "index.html").read_text()
    for entry in journal_of(out):
        for check in entry.get("verification", ()):
            assert f"delivered {check['ciede2000']:.2f} from {check['target']}" in text
    assert text.count("; delivered ") == 4


@pytest.fixture
def browser(tmp_path):
    if PROGRAM is None:
        pytest.skip("no Chromium here: apt-get install chromium")
    made = Chromium(tmp_path / "profile")
    yield made
    made.close()


def test_in_a_browser(out, browser, tmp_path):
    # Elsewhere, alone: nothing of the run is beside it.
    page = tmp_path / "elsewhere" / "page.html"
    page.parent.mkdir()
    shutil.copy(out / "index.html", page)
    browser.open(page.as_uri())
    asked = [e["params"]["request"]["url"] for e in browser.events if e["method"] == "Network.requestWillBeSent"]
    assert all(url.startswith(("file:", "data:", "about:")) for url in asked)
    assert not [e for e in browser.events if e["method"] in ("Runtime.exceptionThrown", "Log.entryAdded")]

    assert browser.evaluate("document.title") == "Dyehouse: 4 done, 0 need a person, 1 failed"
    statuses = browser.evaluate("[...document.querySelectorAll('article')].map(a => a.dataset.status)")
    assert statuses == ["failed", "done", "done", "done", "done"]
    errors = browser.evaluate("[...document.querySelectorAll('article')].slice(1).map(a => +a.dataset.error)")
    assert errors == sorted(errors, reverse=True)

    box = browser.evaluate(
        "(() => { const r = document.querySelector('figure').getBoundingClientRect();"
        " return [r.left, r.top, r.width, r.height] })()"
    )
    left, top, width, height = (round(v) for v in box)
    name = browser.evaluate("document.querySelector('article[data-status=done] h2').textContent")
    sheet = np.array(Image.open(out / "sheets" / f"{name.partition('.')[0]}.jpg"))
    column = 1 if "navy" in name else 2
    before = sheet[GAP : GAP + height, GAP : GAP + width].astype(int)
    after = sheet[GAP : GAP + height, GAP + column * (width + GAP) :][:, :width].astype(int)

    def shown(share):
        browser.click(left + share * width, top + height / 2)
        picture = browser.screenshot()[top : top + height, left : left + width].astype(int)
        return picture[: height // 3]  # above the slider's own handle

    def near(picture, wanted):
        return np.abs(picture - wanted[: height // 3]).mean() < 2

    assert not near(before[: height // 3], after)
    assert near(shown(0.999), before)
    assert near(shown(0.001), after)
    half = shown(0.5)
    assert np.abs(half[:, : width // 2 - 8] - before[: height // 3, : width // 2 - 8]).mean() < 2
    assert np.abs(half[:, width // 2 + 8 :] - after[: height // 3, width // 2 + 8 :]).mean() < 2

    visible = "[...document.querySelectorAll('article')].filter(a => a.getBoundingClientRect().height).length"
    choose = (
        "(() => {{ const s = document.getElementById('{}'); s.value = '{}'; s.dispatchEvent(new Event('input')) }})()"
    )
    browser.evaluate(choose.format("which", "failed"))
    assert browser.evaluate(visible) == 1
    browser.evaluate(choose.format("which", ""))
    browser.evaluate(choose.format("named", "BALL1"))
    assert browser.evaluate(visible) == 2
