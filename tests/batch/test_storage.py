"""Photos and results at URLs: fsspec's memory and a local HTTP server, and words where something is missing."""

import functools
import http.server
import json
import sys
import threading

import fsspec
import pytest

from dyehouse.batch import storage
from dyehouse.batch.cli import main
from dyehouse.core.errors import FileError

from .catalogs import catalog, files_of


@pytest.fixture
def memory():
    filesystem = fsspec.filesystem("memory")
    yield filesystem
    filesystem.store.clear()
    filesystem.pseudo_dirs[:] = [""]


@pytest.fixture
def served(tmp_path):
    """A local HTTP server over a folder; gives the folder and its URL."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    folder = tmp_path / "served"
    folder.mkdir()
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield folder, f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


def batch(*arguments):
    return main(["batch", *[str(a) for a in arguments], "--workers", "0"])


@pytest.fixture
def plain(tmp_path, product):
    """A catalog of this disk, and its files."""
    table = catalog(tmp_path / "shop", product)
    assert batch(table, "--out", tmp_path / "plain") == 0
    return table, {name: digest for name, digest in files_of(tmp_path / "plain").items() if name != "index.html"}


def test_memory_in_and_out(tmp_path, plain, memory, capsys):
    table, expected = plain
    for path in (table.parent / "photos").iterdir():
        memory.pipe(f"/shop/{path.name}", path.read_bytes())
    table.write_text(table.read_text().replace("photos/", "memory://shop/"))
    journal = tmp_path / "journal.jsonl"
    arguments = (table, "--out", "memory://done/x", "--journal", journal)
    assert batch(*arguments, "--check") == 0
    assert batch(*arguments) == 0
    found = {name.removeprefix("/done/x/"): memory.cat(name) for name in memory.find("/done/x")}
    (tmp_path / "copy").mkdir()
    for name, data in found.items():
        (tmp_path / "copy" / name).parent.mkdir(exist_ok=True)
        (tmp_path / "copy" / name).write_bytes(data)
    assert {n: d for n, d in files_of(tmp_path / "copy").items() if n != "index.html"} == expected
    assert b"sheets/ball0.jpg" in found["index.html"]

    memory.rm("/done/x/ball1-navy.png")
    capsys.readouterr()
    assert batch(*arguments, "--resume") == 0
    assert "1 done, 5 kept" in capsys.readouterr().out
    assert batch(*arguments) == 2  # it is all there already
    assert "exists already" in capsys.readouterr().err


def test_patterns_in_memory(tmp_path, plain, memory):
    table, _ = plain
    for path in (table.parent / "photos").iterdir():
        memory.pipe(f"/shop/{path.name}", path.read_bytes())
    table.write_text("photo,target\nmemory://shop/*.png,#1F4E79\n")
    assert batch(table, "--out", tmp_path / "out", "--no-sheets") == 0
    assert sorted(files_of(tmp_path / "out")) == [f"ball{k}-#1F4E79.png" for k in range(3)]


def test_photos_from_a_web_server(tmp_path, plain, served, capsys):
    table, expected = plain
    folder, url = served
    for path in (table.parent / "photos").iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    text = table.read_text().replace("photos/", f"{url}/")
    table.write_text(text + f"{url}/no.png,,x=#fff\n")
    assert batch(table, "--out", tmp_path / "out", "--check") == 2
    assert f"'{url}/no.png' does not exist" in capsys.readouterr().err
    assert batch(table, "--out", tmp_path / "out") == 1
    assert f"'{url}/no.png' does not exist" in capsys.readouterr().err
    assert {n: d for n, d in files_of(tmp_path / "out").items() if n != "index.html"} == expected


def test_a_web_server_that_does_not_answer(tmp_path, capsys):
    (tmp_path / "t.csv").write_text("photo,target\nhttp://127.0.0.1:1/a.png,#fff\n")
    assert batch(tmp_path / "t.csv", "--out", tmp_path / "out") == 1
    assert "'http://127.0.0.1:1/a.png' cannot be reached" in capsys.readouterr().err


def test_a_damaged_photo_is_called_by_its_url(tmp_path, memory, capsys):
    memory.pipe("/a.png", b"\x89PNG no more")
    (tmp_path / "t.csv").write_text("photo,target\nmemory://a.png,#fff\n")
    assert batch(tmp_path / "t.csv", "--out", tmp_path / "out") == 1
    err = capsys.readouterr().err
    assert "memory://a.png' is " in err
    assert "/tmp/dyehouse-" not in err


def test_a_journal_cannot_be_at_a_url(plain, memory, capsys):
    assert batch(plain[0], "--out", "memory://done") == 2
    assert "give one of this machine with --journal FILE" in capsys.readouterr().err


def test_without_fsspec(plain, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    assert batch(plain[0], "--out", "memory://done", "--journal", "x") == 2
    assert "pip install 'fsspec[http]'" in capsys.readouterr().err


def test_a_kind_of_url_that_nobody_knows():
    with pytest.raises(FileError, match="cannot be reached"):
        storage.exists("nothing://a/b")


def test_a_store_without_rename_gets_whole_files_only(tmp_path, memory):
    # fsspec's own view of this disk: a store that is written beside and renamed.
    with storage.arriving(f"file://{tmp_path}/sub/a.txt") as place:
        place.write_text("whole")
    assert [p.name for p in (tmp_path / "sub").iterdir()] == ["a.txt"]
    with pytest.raises(UnicodeEncodeError), storage.arriving("memory://b.txt") as place:
        place.write_text("half \udce9", encoding="ascii")
    assert not memory.exists("/b.txt")


def test_digests(tmp_path, memory):
    memory.pipe("/a", b"x")
    (tmp_path / "a").write_bytes(b"x")
    assert storage.digest_at("memory://a") == storage.digest_at(str(tmp_path / "a")) != ""
    assert storage.digest_at("memory://b") == storage.digest_at(str(tmp_path / "b")) == ""
    assert json.dumps(sorted(storage.listing(str(tmp_path)))) == '["a"]'
