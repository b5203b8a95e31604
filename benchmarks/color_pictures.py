"""The pictures of docs/color.md: `uv run python -m dyehouse.benchmarks.color_pictures`.

Every figure in them is computed here.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..batch import demo, files, photo
from ..batch.sheet import contact_sheet
from ..core import colorimetry, gamut, metamerism, spectra
from ..core.colorspace import SRGB
from ..core.recipe import Recipe, Region
from ..core.spectra import Spectrum
from ..core.swatches import Swatch, parse_target

FIGURES = Path(__file__).resolve().parent.parent / "docs" / "figures"
LIGHTS = ("D65", "A", "FL11", "LED-B3")
PATCHES = ("orange", "foliage", "purple", "cyan")

type Cell = tuple[str, NDArray[np.uint8]]


def chip(*codes: NDArray | list[float], height: int = 110, width: int = 230) -> NDArray[np.uint8]:
    """Areas of sRGB codes (3,), 0..1, side by side."""
    parts = [np.full((height, width // len(codes), 3), np.rint(255 * np.clip(code, 0, 1)), np.uint8) for code in codes]
    return np.concatenate(parts, axis=1)


def codes_of(linear: NDArray) -> NDArray[np.float64]:
    """Codes to show linear sRGB by, paler where sRGB does not hold it."""
    pixels = np.array(linear, np.float32).reshape(1, 3)
    gamut.fit_to_gamut(pixels)
    return SRGB.curve.encode(np.clip(pixels[0], 0, 1))


def linear_light() -> list[list[Cell]]:
    """Half the light is not half the code."""
    path = demo.sample_photo("coffee.png")
    codes = files.read(path).pixels[..., :3]
    half = SRGB.curve.encode(SRGB.curve.decode(codes / 255) / 2)
    rows: list[Cell] = [
        ("photo", codes),
        ("half the light", np.rint(255 * half).astype(np.uint8)),
        ("half of every code", (codes // 2).astype(np.uint8)),
    ]
    return [rows]


def white() -> list[list[Cell]]:
    """One product, one target, three whites."""
    opened = files.read(demo.sample_photo("coffee.png"))
    target, cells = parse_target("lch(30, 55, 290)"), []
    whites: dict[str, str | tuple[float, ...]] = {
        "white of the photo": (395.0, 90.0),
        "taken for bluer light": (0.75, 0.95, 1.3),
        "taken for redder": "A",
    }
    for label, chosen in whites.items():
        region = Region(target, click=(120, 250), model="dichromatic")
        prepared = photo.look(opened, Recipe((region,), white=chosen))
        pixels, _ = photo.recolored(opened, prepared, "x.png")
        cells.append((label, np.ascontiguousarray(pixels[90:330, 60:420, :3])))
    return [cells]


def other_light() -> list[list[Cell]]:
    """The same patches under four lights: as a camera that does not follow sees them, and as the eye does."""
    rows = []
    for name in PATCHES:
        swatch = parse_target(f"ColorChecker#{name}")
        looks = metamerism.under_lights(swatch, LIGHTS)
        row: list[Cell] = []
        for look in looks:
            camera = codes_of(swatch.to_linear(SRGB, look.light))
            row.append((f"{name}, {look.light}: {look.shift:.1f}", chip(camera, look.display)))
        rows.append(row)
    return rows


def observers() -> list[list[Cell]]:
    """The same spectra for both standard observers."""
    row: list[Cell] = []
    for name in PATCHES:
        swatch = parse_target(f"ColorChecker#{name}")
        both = [swatch.to_linear(SRGB, observer=year) for year in ("1931", "1964")]
        apart = float(colorimetry.delta_e_2000(*(colorimetry.linear_to_lab(pixel, SRGB) for pixel in both)))
        row.append((f"{name}, 2 and 10 deg: {apart:.1f}", chip(*(codes_of(pixel) for pixel in both))))
    return [row]


def metamer_of(swatch: Swatch, strength: float = 0.12) -> Swatch:
    """Make another reflectance that no 2° observer can tell from a swatch under D65."""
    assert isinstance(swatch.color, Spectrum)
    nm = swatch.color.wavelengths
    sensors = spectra.to_xyz("D65", Spectrum(nm, np.eye(len(nm))))
    wave = np.sin(nm / 22)
    unseen = wave - sensors @ np.linalg.solve(sensors.T @ sensors, sensors.T @ wave)
    values = swatch.color.values + strength * unseen / np.abs(unseen).max()
    return Swatch.from_spectrum(Spectrum(nm, values), "metamer")


def metamers() -> list[list[Cell]]:
    """A pair that matches in daylight and not in the shop."""
    swatch = parse_target("ColorChecker#neutral 5 (.70 D)")
    other, row = metamer_of(swatch), []
    for light in LIGHTS:
        pair = [metamerism.under_lights(s, (light,))[0].display for s in (swatch, other)]
        index = metamerism.special_index(swatch, other, light).value
        row.append((f"{light}: index {index:.1f}", chip(*pair)))
    return [row]


def out_of_gamut() -> list[list[Cell]]:
    """What becomes of colors that sRGB does not hold."""
    rows = []
    for text in ("lab(55, -85, 30)", "lch(50, 105, 285)", "lch(60, 105, 60)"):
        asked = parse_target(text).to_linear(SRGB)
        pale = np.array(asked, np.float32).reshape(1, 3)
        gamut.fit_to_gamut(pale)
        ways = {
            "channels cut": np.clip(asked, 0, 1),
            "toward grey": pale[0].astype(np.float64),
            "nearest, hue of CIELAB": gamut.nearest(asked, SRGB, "lab").linear,
            "nearest, hue of Oklch": gamut.nearest(asked, SRGB, "oklch").linear,
        }
        lab = colorimetry.linear_to_lab(asked, SRGB)
        row: list[Cell] = []
        for label, linear in ways.items():
            away = float(colorimetry.delta_e_2000(lab, colorimetry.linear_to_lab(linear, SRGB)))
            row.append((f"{label}: {away:.1f}", chip(SRGB.curve.encode(np.clip(linear, 0, 1)))))
        rows.append(row)
    return rows


def main() -> None:
    """Make all pictures."""
    FIGURES.mkdir(parents=True, exist_ok=True)
    for name, rows, width in (
        ("color_linear.jpg", linear_light(), 300),
        ("color_white.jpg", white(), 300),
        ("color_light.png", other_light(), 230),
        ("color_observer.png", observers(), 230),
        ("color_metamers.png", metamers(), 230),
        ("color_gamut.png", out_of_gamut(), 230),
    ):
        sheet = contact_sheet(rows, width)
        files.write(FIGURES / name, sheet, files.Photo(Path(), sheet, SRGB), force=True, quality=88)
        print(f"docs/figures/{name}")


if __name__ == "__main__":
    main()
