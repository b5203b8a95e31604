"""`blender --command dyehouse batch`: a catalog inside Blender gives the files of the command line."""

import sys
from pathlib import Path
from types import ModuleType

import pytest

from dyehouse.batch.cli import main


def test_the_same_files_as_the_command_line(extension: ModuleType, table: Path, tmp_path: Path) -> None:
    from installed_dyehouse.addon import command

    assert main(["batch", str(table), "--out", str(tmp_path / "one"), "--workers", "0"]) == 0
    assert command._run(["batch", str(table), "--out", str(tmp_path / "two"), "--workers", "0"]) == 0
    one, two = (
        {p.relative_to(out).as_posix(): p.read_bytes() for p in out.rglob("*") if p.is_file() and p.suffix != ".jsonl"}
        for out in (tmp_path / "one", tmp_path / "two")
    )
    assert len(one) == 6
    assert one == two


def test_what_blender_does_not_have_is_said_in_words(
    extension: ModuleType,
    table: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    from installed_dyehouse.addon import command

    for name in ("rich.progress", "distributed", "fsspec.core"):
        monkeypatch.setitem(sys.modules, name, None)
    arguments = ["batch", str(table), "--out", str(tmp_path / "out"), "--workers", "0"]
    assert command._run([*arguments, "--scheduler", "tcp://127.0.0.1:1"]) == 2
    assert "needs dask.distributed, which is not installed" in capsys.readouterr().err
    assert command._run([*arguments[:-3], "memory://x", "--journal", str(tmp_path / "j")]) == 2
    assert "needs fsspec" in capsys.readouterr().err
    assert command._run([*arguments, "--resume"]) == 0
    assert "3 done" in capsys.readouterr().out
