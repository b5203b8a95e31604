"""How long Blender's window stands still while a designer works on 24 megapixels.

    uv run python -m dyehouse.benchmarks.window

The longest time between two turns of Blender's main loop in each step, by the clock and of the main thread's own work:
where a graphics card is imitated by the CPU, or other programs are busy, the clock says more than Dyehouse takes. Needs
the Blender of `tools/setup-debian-blender.sh`, as `tests/gui` does, whose harness it uses.
"""

import argparse
import json
import shutil
import sys
import tempfile
from importlib import import_module
from pathlib import Path

import skimage

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args()
    sys.path[:0] = [str(ROOT / "tests" / "gui"), str(ROOT / "tools")]
    harness, tool = import_module("conftest"), import_module("build_extension")
    command = harness.find_blender()
    if isinstance(command, str):
        sys.exit(command)
    steps = ROOT / "tests" / "gui" / "window_steps.py"
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch, "run")
        folder.mkdir()
        shutil.copy(Path(skimage.__file__).parent / "data" / "coffee.png", folder / "photo.png")
        blender = harness.Blender(command, Path(scratch, "blender"), tool.build(ROOT, folder))
        for scenario in harness.names(steps):
            blender.window(steps, [scenario], folder).check(scenario)
        for found in sorted(folder.glob("*.json")):
            print(f"\n{found.stem}, 24 megapixels\n")
            print("| step | clock (s) | main thread (s) | whole step (s) |\n|---|---|---|---|")
            for name, gap in json.loads(found.read_text()).items():
                print(f"| {name} | {gap['clock']:.2f} | {gap['thread']:.2f} | {gap['whole']:.1f} |")


if __name__ == "__main__":
    main()
