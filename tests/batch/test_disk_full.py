"""A disk that is really full: a small file system in memory, mounted for the test alone."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from dyehouse.batch import files
from dyehouse.core.colorspace import SRGB

# Its own mount name space: the mount is gone when the process ends, and needs root of that space only.
_INSIDE = """
set -eu
mount -t tmpfs -o size=64k none "$1"
printf old > "$1/kept$3"
status=0
"$4" -m dyehouse recolor "$2" --reference 20,20 --target "#1F4E79" -o "$1/new$3" || status=$?
again=0
"$4" -m dyehouse recolor "$2" --reference 20,20 --target "#1F4E79" --force -o "$1/kept$3" || again=$?
echo "status $status $again"
echo "files" $(ls -A "$1")
echo "kept" $(cat "$1/kept$3")
"""


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".exr", ".webp"])
def test_nothing_is_left_and_nothing_is_lost(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(0)
    codes = rng.integers(40, 200, (400, 400, 3), np.uint8)  # noise: no format makes it small
    source, disk = tmp_path / "photo.png", tmp_path / "disk"
    files.write(source, codes, files.Photo(source, codes, SRGB))
    disk.mkdir()
    unshare = shutil.which("unshare")
    assert unshare, "the test needs unshare, of util-linux"
    done = subprocess.run(
        [unshare, "--mount", "--map-root-user", "sh", "-c", _INSIDE, "sh", disk, source, suffix, sys.executable],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "status 2 2" in done.stdout
    assert f"files kept{suffix}\n" in done.stdout
    assert "kept old" in done.stdout
    said = [line for line in done.stderr.splitlines() if line.startswith("dyehouse: ")]
    assert len(said) == 2
    assert all("No space left" in line for line in said)
    assert "Traceback" not in done.stderr
