"""Build and validate the Blender extension, with the tool that Blender's Python module carries.

    uv run python tools/build_extension.py [--source DIR] [--out DIR]

The zip holds what `blender_manifest.toml` lists and nothing else; its path is printed.
"""

import argparse
import importlib.util
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LARGEST = 1_000_000  # bytes


def _tool() -> Path:
    """`blender_ext.py`, found without importing bpy."""
    found = importlib.util.find_spec("bpy")
    if found is None or found.origin is None:
        sys.exit("bpy is not installed; run `uv sync` first")
    return next(Path(found.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))


def _run(*arguments: str) -> None:
    done = subprocess.run([sys.executable, str(_tool()), *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{arguments[0]} failed:\n{done.stdout}{done.stderr}")


def build(source: Path, out: Path) -> Path:
    """Build the extension of the folder `source` into the folder `out`, validate it, and return the zip's path."""
    manifest = tomllib.loads((source / "blender_manifest.toml").read_text())
    package = out / f"{manifest['id']}-{manifest['version']}.zip"
    out.mkdir(parents=True, exist_ok=True)
    _run("validate", str(source))
    _run("build", "--source-dir", str(source), "--output-filepath", str(package))
    _run("validate", str(package))
    if (size := package.stat().st_size) >= LARGEST:
        sys.exit(f"{package} has {size} bytes and must stay under {LARGEST}")
    return package


def main() -> None:
    """Read the command line and build."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--source", type=Path, default=ROOT, help="folder with blender_manifest.toml")
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder for the zip")
    arguments = parser.parse_args()
    print(build(arguments.source, arguments.out))


if __name__ == "__main__":
    main()
