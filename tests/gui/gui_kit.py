"""Drive a real Blender window from inside, with real mouse and keyboard events.

A scenario is a generator. It yields seconds to wait, or a function to wait for until that returns something true. An
exception fails the scenario, the end of the generator passes it:

    import gui_kit as gui

    def picks_the_reference():
        image = gui.load("photo.png")
        window, area, region = yield from gui.image_editor(image, tab="Dyehouse")
        gui.call(window, area, region, bpy.ops.dyehouse.pick_reference, "INVOKE_DEFAULT")
        yield gui.redrawn
        yield from gui.click(*gui.at(region, image, 120, 80))
        yield gui.idle
        assert ...

Every scenario starts from the factory's start-up file, in the same window as the one before. Pixel positions (x, y)
count from the picture's top left, window positions from the window's bottom left, as Blender's events do.
"""

import contextlib
import importlib.util
import itertools
import os
import subprocess
import sys
import threading
import traceback
from pathlib import Path
from time import monotonic, thread_time

import bpy
import numpy as np

PAUSE = 0.05  # seconds between two events of one gesture: Blender reads the state of keys when it gets to them
STEP = 60.0  # seconds after which a step has waited in vain, on a slow and busy machine
folder = Path()  # scratch folder of this run: photo.png is there, and results may be left there
_frames = 0
_mark = 0


def run(file, where, names):
    """Run the scenarios `names` of the Python file `file`, print how each ended, and leave Blender."""
    global folder
    folder = Path(where)
    spec = importlib.util.spec_from_file_location(Path(file).stem, file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    # A window that hangs in a call of Blender must end as well.
    watchdog = threading.Timer(300.0 + 120.0 * len(names), _leave, ["no end in sight"])
    watchdog.daemon = True
    watchdog.start()
    queue = [(name, getattr(module, name)) for name in names]
    steps = None
    name = ""
    wait, deadline = None, 0.0

    def tick():
        nonlocal steps, name, wait, deadline
        global _mark
        try:
            if steps is None:
                if not queue:
                    _leave("end")
                name, scenario = queue.pop(0)
                print("gui: begin", name, flush=True)
                _start_afresh()
                steps, wait = scenario(), redrawn
                deadline, _mark = monotonic() + STEP, _frames
            if wait is not None and not wait():
                if monotonic() > deadline:
                    raise TimeoutError(f"waited {STEP:g} s in vain for {wait}")
                _redraw()
                return 0.03
            _mark = _frames
            wait = next(steps)
            if not callable(wait):
                seconds, wait = float(wait), None
                return seconds
            deadline = monotonic() + STEP
            _redraw()
            return 0.01
        except StopIteration:
            print("gui: passed", name, flush=True)
        except Exception:
            print("gui: failed", name, flush=True)
            traceback.print_exc(file=sys.stdout)
            with contextlib.suppress(Exception):
                screenshot(folder / f"failed-{name}.png")
        steps = None
        return 0.01

    bpy.app.timers.register(tick, first_interval=0.1, persistent=True)


def _leave(why):
    print("gui:", why, flush=True)
    sys.stderr.flush()
    os._exit(0)  # without a question about unsaved changes; the harness judges by what was printed


def _start_afresh():
    global _page
    _xdo("mousemove", 0, 0)
    _page = 0
    with bpy.context.temp_override(window=main_window()):
        bpy.ops.wm.read_homefile(use_factory_startup=True, load_ui=True)
    for space in (bpy.types.SpaceImageEditor, bpy.types.SpaceView3D, bpy.types.SpaceNodeEditor):
        if space not in _counted:
            space.draw_handler_add(_count, (), "WINDOW", "POST_PIXEL")
            _counted.add(space)


_counted = set()


def _count():
    global _frames
    _frames += 1


def _redraw():
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in {"IMAGE_EDITOR", "VIEW_3D", "NODE_EDITOR"}:  # those that count; software OpenGL is slow
                area.tag_redraw()


# --- what to wait for ---


def redrawn():
    """Tell whether the editors were drawn twice since the step began."""
    return _frames >= _mark + 2


def idle():
    """Tell whether no modal operator runs and the editors were drawn since."""
    return not any(window.modal_operators for window in bpy.context.window_manager.windows) and redrawn()


def settle():
    """Wait until the extension has nothing more to compute and the editors show it; `yield from` it."""
    from bl_ext.user_default.dyehouse.addon import background

    quiet = 0
    while quiet < 3:  # what is done in a thread may begin the next thing when it is drawn
        yield redrawn
        quiet = 0 if background.busy() else quiet + 1


# --- windows, editors, pictures ---


def main_window():
    """Blender's window."""
    return bpy.context.window_manager.windows[0]


def region_of(area, kind="WINDOW"):
    """The area's region of that kind."""
    return next(region for region in area.regions if region.type == kind)


def load(name):
    """Open a picture of the scratch folder (or any path) as an image datablock."""
    return bpy.data.images.load(str(folder / name))


def editor(kind):
    """Turn the largest area into an editor of that kind ("IMAGE_EDITOR", "NODE_EDITOR", ...): window, area, region."""
    window = main_window()
    area = max(window.screen.areas, key=lambda area: area.width * area.height)
    area.type = kind
    return window, area, region_of(area)


def image_editor(image, tab=None, zoom=0):
    """Show `image` in the largest area, sidebar open on `tab`: `yield from` gives window, area, region.

    `zoom` is how many pixels of the screen a pixel gets; 0 fits the whole picture.
    """
    window, area, region = editor("IMAGE_EDITOR")
    area.spaces.active.image = image
    yield from sidebar(area, tab)
    if zoom:
        call(window, area, region, bpy.ops.image.view_zoom_ratio, ratio=zoom)
    else:
        call(window, area, region, bpy.ops.image.view_all, fit_view=True)
    yield redrawn
    return window, area, region


def sidebar(area, tab):
    """Open the sidebar on `tab`, or close it when `tab` is None; to be used with `yield from`."""
    area.spaces.active.show_region_ui = tab is not None
    yield redrawn  # the tabs exist only after the sidebar was drawn
    if tab is not None:
        region_of(area, "UI").active_panel_category = tab
        yield redrawn


def open_panel(name):
    """Have a panel drawn opened, by the name of its class, that is closed at first; before the sidebar is opened."""
    cls = getattr(bpy.types, name)
    bpy.utils.unregister_class(cls)
    cls.bl_options = set()
    bpy.utils.register_class(cls)


def call(window, area, region, operator, *arguments, **properties):
    """Call an operator as if the mouse were in that region."""
    with bpy.context.temp_override(window=window, area=area, region=region):
        return operator(*arguments, **properties)


def at(region, image, x, y):
    """Window position of the center of the picture's pixel (x, y), counted from the top left."""
    width, height = image.size
    rx, ry = region.view2d.view_to_region((x + 0.5) / width, 1 - (y + 0.5) / height, clip=False)
    return region.x + rx, region.y + ry


# --- mouse and keyboard ---


def _xdo(*arguments):
    subprocess.run(["xdotool", *map(str, arguments)], check=True)


def _place(x, y):
    """X's position; there is no window manager, so the window sits at the screen's bottom left."""
    return np.rint(x).astype(int), np.rint(main_window().height - 1 - y).astype(int)


def move(x, y):
    """Move the mouse."""
    _xdo("mousemove", *_place(x, y))


def click(x, y, button=1, hold=()):
    """Click with a button (1 left, 2 middle, 3 right) while the keys `hold` are down ("shift"); `yield from` it."""
    move(x, y)
    yield PAUSE
    if hold:
        _xdo("keydown", *hold)
        yield PAUSE
    _xdo("click", button)
    yield PAUSE
    if hold:
        _xdo("keyup", *hold)
        yield PAUSE


def drag(*points, steps=8, between=None):
    """Drag with the left button along the points; `yield from` it. `between` is a generator function to run on the way.

    It runs before the button is let go.
    """
    move(*points[0])
    yield PAUSE
    _xdo("mousedown", 1)
    for a, b in itertools.pairwise(points):
        for i in range(1, steps + 1):
            yield PAUSE
            move(*(p + (q - p) * i / steps for p, q in zip(a, b, strict=True)))
    yield PAUSE
    if between:
        yield from between()
    _xdo("mouseup", 1)
    yield PAUSE


def key(name):
    """Press a key by X's name: Escape, Return, ctrl+z, ..."""
    _xdo("key", name)


def write(text):
    """Type a text."""
    _xdo("type", "--delay", 20, text)


def undo():
    """Undo one step, as Ctrl Z does."""
    with bpy.context.temp_override(window=main_window()):
        return bpy.ops.ed.undo()


def redo():
    """Redo one step."""
    with bpy.context.temp_override(window=main_window()):
        return bpy.ops.ed.redo()


# --- buttons of the sidebar, and of the Properties editor ---


def find(area, name, across=0.6):
    """Window position of a button in the sidebar, found by moving the mouse down over it; `yield from` it.

    `name` is an operator's id ("dyehouse.pick_white") or how the path of a property ends ("white_source"); `across` is
    how far from the sidebar's left edge to look, 0 to 1.
    """
    ui = _buttons(area)
    x = ui.x + ui.width * across
    remembered = _found.get((area.ui_type, name))
    pages = [*range(_page, _PAGES), *range(_page)]  # from where it is scrolled to
    for page in ([remembered[0]] if remembered else []) + pages:
        yield from scroll(area, page)
        heights = list(range(ui.y + ui.height - 8, ui.y + 24, -14))  # a button is 20 high
        if remembered:
            heights.insert(0, remembered[1])
        for y in heights:
            move(x, y)
            yield PAUSE
            if not _hovered(area, ui).endswith(name):
                continue
            yield 2 * PAUSE  # it may be the one before, not yet left
            if _hovered(area, ui).endswith(name):
                _found[area.ui_type, name] = page, y
                return x, y
    raise LookupError(f"no button {name} in the sidebar")


_PAGES = 5  # of a long sidebar
_page = 0  # where it is scrolled to
_found = {}  # page and height of a button, where it was last time


def scroll(area, page):
    """Scroll to a page of the sidebar with the mouse wheel; a short sidebar would pass it on to the picture."""
    global _page
    if page != _page:
        ui = _buttons(area)
        move(ui.x + 4, ui.y + ui.height * 0.5)  # beside the lists, which have a wheel of their own
        yield PAUSE
        _xdo("click", "--repeat", 10 * abs(page - _page), "--delay", 1, 5 if page > _page else 4)
        _page = page
        yield redrawn


def _buttons(area):
    return region_of(area, "WINDOW" if area.type == "PROPERTIES" else "UI")


def _hovered(area, region):
    """The property's path or the operator's id of the button under the mouse."""
    with bpy.context.temp_override(window=main_window(), area=area, region=region):
        if bpy.context.property:
            return bpy.context.property[1]
        if not bpy.ops.ui.copy_python_command_button.poll():
            return ""
        bpy.ops.ui.copy_python_command_button()
        return bpy.context.window_manager.clipboard.removeprefix("bpy.ops.").partition("(")[0]


def color_wheel(before):
    """Window position of the middle of the wheel in the color picker that opened since `before` was on the screen."""
    now = screen()
    picker = (now != before).any(-1) & (now == (24, 24, 24)).all(-1)  # its background
    assert picker.sum() > 10000, "the color picker did not open"
    (top, *_), (left, *_) = (np.flatnonzero(picker.sum(axis=axis) > 50) for axis in (1, 0))
    return left + 92, main_window().height - 1 - top - 91


def press(area, name, across=0.6):
    """Find a button of the sidebar and click it; `yield from` it."""
    yield from click(*(yield from find(area, name, across)))


# --- whether the window goes on ---


class Pulse:
    """Notes when Blender's main loop comes round, and how long its thread has worked by then, till it is stopped."""

    def __init__(self):
        self._beats, self._stopped = [], False
        bpy.app.timers.register(self._beat, first_interval=0.0, persistent=True)

    def _beat(self):
        self._beats.append((monotonic(), thread_time()))
        return None if self._stopped else 0.005

    def stop(self):
        """Take no more notes."""
        self._stopped = True

    def longest(self, begun):
        """Longest gap in seconds since a moment (`time.monotonic`): by the clock, and of the main thread's own work."""
        beats = np.array([beat for beat in self._beats if beat[0] >= begun])
        gaps = np.diff(beats, axis=0).max(axis=0)
        return {"clock": float(gaps[0]), "thread": float(gaps[1])}


# --- what the screen shows ---


def screen():
    """The screen as (height, width, 3) uint8 codes, top row first. Index it with `screen()[place(x, y)]`."""
    shot = subprocess.run(["import", "-window", "root", "-depth", "8", "rgb:-"], check=True, capture_output=True).stdout
    size = subprocess.run(["xdotool", "getdisplaygeometry"], check=True, capture_output=True, text=True).stdout.split()
    return np.frombuffer(shot, np.uint8).reshape(int(size[1]), int(size[0]), 3)


def place(x, y):
    """Row and column of a window position in `screen()`."""
    column, row = _place(x, y)
    return row, column


def picture(region, image):
    """What the screen shows at the centers of the pixels of an image wholly in view: (height, width, 3) uint8."""
    width, height = image.size
    columns = [at(region, image, x, 0)[0] for x in range(width)]
    rows = [at(region, image, 0, y)[1] for y in range(height)]
    rows, columns = place(np.array(columns), np.array(rows))
    return screen()[np.ix_(rows, columns)]


def screenshot(path):
    """Write the whole screen as a PNG."""
    subprocess.run(["import", "-window", "root", str(path)], check=True)


def figure(name, area=None, region=None):
    """Write a picture of an area or region for the pages of docs/, into the folder that DYEHOUSE_SCREENSHOTS names."""
    target = os.environ.get("DYEHOUSE_SCREENSHOTS")
    part = region or area
    if not target:
        return
    crop = []
    if part is not None:
        left, top = _place(part.x, part.y + part.height - 1)
        crop = ["-crop", f"{part.width}x{part.height}+{left}+{top}", "+repage"]
    subprocess.run(
        ["import", "-window", "root", *crop, "-strip", "-quality", "80", str(Path(target) / f"{name}.jpg")], check=True
    )
