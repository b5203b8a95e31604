"""The built extension in a scratch profile of Blender's Python module: install, enable, disable, upgrade."""

import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MANIFEST = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
PREAMBLE = """
import sys
import bpy
NAME = "bl_ext.user_default.dyehouse"
def install(package):
    bpy.ops.extensions.package_install_files(filepath=package, repo="user_default", enable_on_install=False)
def enabled():
    return NAME in bpy.context.preferences.addons
def enable():
    assert bpy.ops.preferences.addon_enable(module=NAME) == {"FINISHED"} and enabled()
def disable():
    assert bpy.ops.preferences.addon_disable(module=NAME) == {"FINISHED"} and not enabled()
def version():
    return ".".join(map(str, __import__("addon_utils").module_bl_info(sys.modules[NAME])["version"]))
"""


class Profile:
    """A scratch profile and home; every run is a process of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.home = folder / "home"
        self.extension = folder / "resources" / "extensions" / "user_default" / "dyehouse"
        self.home.mkdir()

    def run(self, code: str, *arguments: Path | str) -> str:
        """Run the code in Blender's Python with every warning an error, and return what was printed after `BEGIN`."""
        places = {"HOME": str(self.home), "TMPDIR": str(self.home)}
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", PREAMBLE + code, *map(str, arguments)],
            capture_output=True,
            text=True,
            check=False,
            cwd=self.home,
            env=os.environ | places | {"BLENDER_USER_RESOURCES": str(self.folder / "resources")},
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert "Traceback" not in done.stdout + done.stderr, done.stdout + done.stderr
        return (done.stdout + done.stderr).partition("BEGIN\n")[2]

    def files(self) -> set[Path]:
        """All files of the profile and the home."""
        return {p.relative_to(self.folder) for p in self.folder.rglob("*") if p.is_file()}


@pytest.fixture
def profile(tmp_path: Path) -> Profile:
    return Profile(tmp_path)


def test_the_zip_holds_what_the_manifest_lists(package: Path) -> None:
    with zipfile.ZipFile(package) as archive:
        assert set(archive.namelist()) == {"blender_manifest.toml", *MANIFEST["build"]["paths"]}
    assert package.name == f"dyehouse-{MANIFEST['version']}.zip"
    assert package.stat().st_size < 1_000_000


def test_a_manifest_that_blender_refuses_is_not_built(tmp_path: Path) -> None:
    (tmp_path / "blender_manifest.toml").write_text('id = "dyehouse"\nversion = "1.0.0"\n')
    tool = [
        sys.executable,
        str(ROOT / "tools" / "build_extension.py"),
        "--source",
        str(tmp_path),
        "--out",
        str(tmp_path),
    ]
    done = subprocess.run(tool, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "validate failed" in done.stderr
    assert list(tmp_path.iterdir()) == [tmp_path / "blender_manifest.toml"]


def test_it_enables_and_disables_again_and_again_in_silence(profile: Profile, package: Path) -> None:
    printed = profile.run(
        """
install(sys.argv[1])
def names():
    kinds = (bpy.types.Operator, bpy.types.Panel, bpy.types.PropertyGroup, bpy.types.UIList, bpy.types.Menu)
    found = {cls.__name__ for kind in kinds for cls in kind.__subclasses__() if cls.__module__.startswith(NAME)}
    lists = [getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)]
    mine = {f.__name__ for fs in lists if isinstance(fs, list) for f in fs if f.__module__.startswith(NAME)}
    return {n for n in found if hasattr(bpy.types, n)} | mine | {n for n in dir(bpy.types.Image) if n == "dyehouse"}
print("BEGIN", flush=True)
for _ in range(3):
    enable()
    assert "dyehouse" in names()
    disable()
    assert not names(), names()
module = sys.modules[NAME]
for _ in range(2):
    module.register()
    module.unregister()
module.unregister()
assert not names(), names()
""",
        package,
    )
    assert printed == ""


def test_registering_needs_no_heavy_module(profile: Profile, package: Path) -> None:
    """Start-up stays short: numpy alone takes longer to import than the extension may take to register."""
    profile.run(
        """
install(sys.argv[1])
for heavy in ("numpy", "OpenImageIO", "rich"):
    sys.modules[heavy] = None
enable()
rooms = {name.split(".")[3] for name in sys.modules if name.startswith(NAME + ".")}
assert rooms == {"addon"}, rooms
""",
        package,
    )


def test_it_writes_nothing_outside_its_own_folder(profile: Profile, package: Path) -> None:
    profile.run("install(sys.argv[1])", package)
    before = profile.files()
    profile.run("enable(); disable(); enable(); bpy.ops.wm.save_userpref()")
    blenders_own = {Path("resources/config/userpref.blend"), Path("resources/extensions/.cache/compat.dat")}
    beyond = {p for p in profile.files() - before - blenders_own if "__pycache__" not in p.parts}
    assert not beyond
    assert profile.extension.is_dir()


def test_an_upgrade_keeps_it_enabled_and_its_settings(profile: Profile, package: Path, previous_package: Path) -> None:
    scene = profile.folder / "scene.blend"
    profile.run(
        """
install(sys.argv[1])
enable()
assert version() == "0.0.1", version()
image = bpy.data.images.new("photo", 8, 4)
image.use_fake_user = True
settings = image.dyehouse
settings.white_source, settings.white_temperature = "TEMPERATURE", 6100
region = settings.regions.add()
region.name, region.reference, region.tolerance = "Cup", (3, 2), 1.5
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2])
bpy.ops.wm.save_userpref()
""",
        previous_package,
        scene,
    )
    profile.run(
        """
bpy.ops.wm.read_userpref()
assert version() == "0.0.1" and enabled()
install(sys.argv[1])
assert enabled() and version() == sys.argv[3], version()
bpy.ops.wm.open_mainfile(filepath=sys.argv[2])
settings = bpy.data.images["photo"].dyehouse
region, = settings.regions
assert (settings.white_source, settings.white_temperature) == ("TEMPERATURE", 6100)
assert (region.name, tuple(region.reference), region.tolerance) == ("Cup", (3, 2), 1.5)
""",
        package,
        scene,
        MANIFEST["version"],
    )
