"""The speed study runs, and the memory that it reports stays bounded."""

from pathlib import Path

import numpy as np
import pytest

from dyehouse.batch import files
from dyehouse.benchmarks import speed
from dyehouse.core import transfer
from dyehouse.core.colorspace import SRGB


def stored(path: Path, height: int, width: int) -> Path:
    part = transfer.encode(speed.test_picture(500, width), SRGB.curve, np.uint8)
    codes = np.concatenate([part] * (height // 500))
    return files.write(path, codes, files.Photo(path, codes, SRGB))


def test_the_table_has_every_file_format(tmp_path: Path) -> None:
    table = speed.Table()
    linear = speed.test_picture(120, 180)
    speed.arrays(table, linear, rounds=1)
    speed.in_files(table, tmp_path, linear, rounds=1)
    text = str(table)
    for label in ("(a) analyze", "jpg uint8", "png uint8", "tif uint16", "exr float16", "(c) further colorway"):
        assert label in text
    assert len({len(line) for line in text.splitlines()}) == 1


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["jpg", "png"])
def test_memory_is_bounded_and_grows_with_the_decoded_picture_only(tmp_path: Path, suffix: str) -> None:
    peaks = []
    for height in (4000, 8000):
        photo = stored(tmp_path / f"{height}.{suffix}", height, 6000)
        # The plain model: others keep up to three half floats for each pixel, which the test below bounds.
        arguments = ["recolor", str(photo), "--reference", "3000,300", "--target", "#1F4E79", "--model", "dichromatic"]
        peaks.append(speed.process([*arguments, "-o", str(tmp_path / f"{height}-out.{suffix}")])[1])
    assert peaks[0] < 500
    decoded = 4000 * 6000 * 3 / 2**20
    # Twice: the picture, and what the encoder or the file in memory holds of it.
    assert peaks[1] - peaks[0] < 2.2 * decoded


@pytest.mark.slow
def test_a_hundred_megapixels(tmp_path: Path) -> None:
    photo = stored(tmp_path / "large.jpg", 10_000, 10_000)
    output = tmp_path / "out.jpg"
    _, peak = speed.process(["recolor", str(photo), "--click", "5000,250", "--target", "#1F4E79", "-o", str(output)])
    assert files.read(output).pixels.shape == (10_000, 10_000, 3)
    assert peak < 1500
