"""Work in a thread of its own, one piece at a time, with which the Image Editors are drawn when it is done."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator

import bpy


def image_editors() -> Iterator[bpy.types.Area]:
    """Every open Image Editor."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                yield area


def redraw() -> None:
    """Have every Image Editor drawn again."""
    for area in image_editors():
        area.tag_redraw()


class Worker[T]:
    """Makes things that are asked for by a key, and keeps those that were asked for last.

    One is made at a time. What is asked for meanwhile is not queued, for it may be outdated when its turn comes: the
    editors are drawn again when one is done, and then ask for what they want.

    Parameters
    ----------
    kept
        How many are kept at least; as many as there are Image Editors in any case, so that these do not take turns.
    """

    def __init__(self, kept: int = 2) -> None:
        self._kept = kept
        self._made: OrderedDict[Hashable, T | Exception] = OrderedDict()
        self._lock = threading.Lock()
        self._at_work = False
        _workers.append(self)

    def ask(self, key: Hashable, begin: Callable[[], Callable[[], T]]) -> T | None:
        """Return what the key stands for, or None while it is being made.

        Parameters
        ----------
        key
            Changes whenever the thing does.
        begin
            Called here, where Blender may be touched; returns the function that the thread calls, which must not.

        Raises
        ------
        Exception
            That came up when the thing was made.
        """
        found = self.found(key)
        if found is None and not self._at_work:
            make = begin()
            self._at_work = True
            most = max(self._kept, sum(1 for _ in image_editors()))
            threading.Thread(target=self._work, args=(key, make, most), daemon=True).start()
            if not bpy.app.timers.is_registered(_redraw_when_done):
                bpy.app.timers.register(_redraw_when_done, first_interval=0.03)
        return found

    def now(self, key: Hashable, begin: Callable[[], Callable[[], T]]) -> T:
        """Return what the key stands for, made here and now if need be; raises as `ask` does."""
        found = self.found(key)
        if found is None:
            found = begin()()
            self._keep(key, found, self._kept)
        return found

    def found(self, key: Hashable) -> T | None:
        """Return what the key stands for if it has been made, else None; raises as `ask` does."""
        with self._lock:
            thing = self._made.get(key)
            if thing is not None:
                self._made.move_to_end(key)
        if isinstance(thing, Exception):
            raise thing.with_traceback(None)
        return thing

    def take(self, key: Hashable) -> T | None:
        """As `found`, and keep it no longer."""
        found = self.found(key)
        with self._lock:
            self._made.pop(key, None)
        return found

    def busy(self) -> bool:
        """Whether something is being made."""
        return self._at_work

    def forget(self) -> None:
        """Drop everything."""
        with self._lock:
            self._made.clear()

    def _keep(self, key: Hashable, thing: T | Exception, most: int) -> None:
        with self._lock:
            self._made[key] = thing
            while len(self._made) > most:
                self._made.popitem(last=False)

    def _work(self, key: Hashable, make: Callable[[], T], most: int) -> None:
        from ..core.errors import DyehouseError

        thing: T | Exception
        try:
            thing = make()
        except MemoryError:
            thing = DyehouseError("There is not enough memory: close other programs.")
        except Exception as error:
            thing = error
        self._keep(key, thing, most)
        self._at_work = False
        _done.set()


_workers: list[Worker] = []
_done = threading.Event()


def busy() -> bool:
    """Whether anything is being made."""
    return any(worker.busy() for worker in _workers)


def _redraw_when_done() -> float | None:
    still = busy()
    if _done.is_set():
        _done.clear()
        redraw()
    return 0.03 if still else None


def register() -> None:
    """Nothing is begun before it is asked for."""


def unregister() -> None:
    """Drop everything."""
    if bpy.app.timers.is_registered(_redraw_when_done):
        bpy.app.timers.unregister(_redraw_when_done)
    for worker in _workers:
        worker.forget()
