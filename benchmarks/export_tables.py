"""Export the CIE tables of colour-science to `core/tables/spectra.npz`, which `core` reads without it.

Run as ``uv run python -m dyehouse.benchmarks.export_tables``. The data are the CIE's and the chart makers'
own, as printed in colour-science (BSD-3-Clause); each array holds wavelengths in nm and then the values.
"""

from __future__ import annotations

from pathlib import Path

import colour
import numpy as np

OUTPUT = Path(__file__).parent.parent / "core" / "tables" / "spectra.npz"
OBSERVERS = {
    "1931": "CIE 1931 2 Degree Standard Observer",
    "1964": "CIE 1964 10 Degree Standard Observer",
}
CHARTS = ("ISO 17321-1", "ColorChecker N Ohta", "BabelColor Average")
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
    for chart in CHARTS:
        patches = colour.SDS_COLOURCHECKERS[chart]
        wavelengths = next(iter(patches.values())).wavelengths
        found[f"chart/{chart}"] = np.column_stack([wavelengths, *(patch.values for patch in patches.values())])
        found[f"patches/{chart}"] = np.array(list(patches))
    return found


def main() -> None:
    OUTPUT.parent.mkdir(exist_ok=True)
    # mypy takes the names for savez's own keyword arguments.
    np.savez_compressed(OUTPUT, **tables())  # type: ignore[arg-type]
    print(f"{OUTPUT}: {OUTPUT.stat().st_size} bytes")


if __name__ == "__main__":
    main()
