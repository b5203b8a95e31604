"""Export the CIE tables of colour-science and the colors of CSS to `core/tables`, which `core` reads without them.

Run as ``uv run python -m dyehouse.benchmarks.export_tables``. The data are the CIE's and the chart makers'
own, as printed in colour-science (BSD-3-Clause); each array holds wavelengths in nm and then the values. The named
colors are those of CSS Color Module Level 4, 6.1, as Pillow lists them.
"""

from __future__ import annotations

from pathlib import Path

import colour
import numpy as np
from PIL import ImageColor

TABLES = Path(__file__).parent.parent / "core" / "tables"
OUTPUT, CSS_OUTPUT = TABLES / "spectra.npz", TABLES / "css.gpl"
OBSERVERS = {
    "1931": "CIE 1931 2 Degree Standard Observer",
    "1964": "CIE 1964 10 Degree Standard Observer",
}
CHARTS = ("ISO 17321-1", "ColorChecker N Ohta", "BabelColor Average")
# CIE 13.3-1995, and Davis & Ohno 2010, Opt. Eng. 49, 033602.
TEST_COLORS = {
    "CIE 13.3": colour.quality.datasets.SDS_TCS["CIE 1995"],
    "NIST CQS": colour.quality.datasets.SDS_VS["NIST CQS 9.0"],
}
# Ends at 560 nm: it lights printing paper and means nothing to a camera.
LEFT_OUT = "ISO 7589 Sensitometric Printer"


def tables() -> dict[str, np.ndarray]:
    """Collect every array of the file by its name in it."""
    found = {}
    for short, long in OBSERVERS.items():
        observer = colour.MSDS_CMFS[long]
        found[f"observer/{short}"] = np.column_stack([observer.wavelengths, observer.values])
    for name, light in colour.SDS_ILLUMINANTS.items():
        if name != LEFT_OUT:
            found[f"illuminant/{name}"] = np.column_stack([light.wavelengths, light.values])
    basis = list(colour.colorimetry.SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES.values())  # S0, S1, S2
    found["daylight"] = np.column_stack([basis[0].wavelengths, *(function.values for function in basis)])
    for name, camera in colour.MSDS_CAMERA_SENSITIVITIES.items():
        found[f"camera/{name}"] = np.column_stack([camera.wavelengths, camera.values])
    for chart, patches in ({name: colour.SDS_COLOURCHECKERS[name] for name in CHARTS} | TEST_COLORS).items():
        wavelengths = next(iter(patches.values())).wavelengths
        found[f"chart/{chart}"] = np.column_stack([wavelengths, *(patch.values for patch in patches.values())])
        found[f"patches/{chart}"] = np.array(list(patches))
    return found


def css() -> str:
    """Return the colors of CSS as a GIMP palette."""
    lines = ["GIMP Palette", "Name: CSS", "Columns: 0", "#"]
    for name, code in ImageColor.colormap.items():
        red, green, blue = ImageColor.getrgb(code)[:3]
        lines.append(f"{red:3d} {green:3d} {blue:3d}\t{name}")
    return "\n".join(lines) + "\n"


def main() -> None:
    TABLES.mkdir(exist_ok=True)
    CSS_OUTPUT.write_text(css())
    # mypy takes the names for savez's own keyword arguments.
    np.savez_compressed(OUTPUT, **tables())  # type: ignore[arg-type]
    for path in (OUTPUT, CSS_OUTPUT):
        print(f"{path}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
