"""`blender --command dyehouse`, inside Blender's Python."""

from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest

from dyehouse.batch import files
from dyehouse.core.colorspace import SRGB


def test_registers_and_unregisters_twice(extension: ModuleType) -> None:
    from installed_dyehouse.addon import command

    for _ in range(2):
        extension.register()
        assert len(command._handles) == 1
        extension.unregister()
        assert command._handles == []


def test_the_command_recolors(extension: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from installed_dyehouse.addon import command

    assert bpy.app.version[:2] == (5, 2)
    codes = np.full((40, 60, 3), (200, 90, 40), np.uint8)
    source, output = tmp_path / "in.png", tmp_path / "out.png"
    files.write(source, codes, files.Photo(source, codes, SRGB))
    asked = ["recolor", str(source), "--reference", "30,20", "--target", "#1F4E79", "-o", str(output)]
    assert command._run(asked) == 0
    assert (files.read(output).pixels == (0x1F, 0x4E, 0x79)).all()
    assert command._run(asked) == 2
    assert "exists already" in capsys.readouterr().err
