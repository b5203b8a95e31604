"""Jobs of operators: in a thread while the window goes on, with progress, until Esc stops them; at once for scripts."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import bpy

from . import common

if TYPE_CHECKING:
    from concurrent.futures import Future

# Seconds between looks at the thread.
_INTERVAL = 0.05

# Where jobs are shown, and in which part of the editor.
_SHOWN_IN = {"IMAGE_EDITOR": "UI", "NODE_EDITOR": "UI", "PROPERTIES": "WINDOW"}


class Stopped(Exception):  # noqa: N818, no error
    """The user does not want the rest."""


class Job:
    """Work in steps, each with a part for any thread, and a part for Blender's own after it."""

    def __init__(self) -> None:
        self._stop = threading.Event()
        self._share = 0.0

    def work(self) -> Any:
        """Do the next step, in any thread; returns what `finish` needs for it.

        Raises
        ------
        Stopped
            After `stop`.
        DyehouseError
            If it cannot be done.
        """
        raise NotImplementedError

    def finish(self, made: Any) -> bool:
        """Complete the step, in Blender's thread; tells whether there is another."""
        raise NotImplementedError

    def progress(self) -> tuple[float, int, str]:
        """How much is done, of how much, and what is going on."""
        raise NotImplementedError

    def rest(self) -> str:
        """What there is now that the job was stopped, in words."""
        raise NotImplementedError

    def close(self) -> None:
        """Give back what the job holds, in any thread, when none works on it any more."""

    def watch(self, share: float) -> None:
        """Take note of the share of the step that is done; the work calls it now and then, and `Stopped` ends it."""
        self._share = share
        if self._stop.is_set():
            raise Stopped

    def stop(self) -> None:
        """End as soon as possible."""
        self._stop.set()

    @property
    def stopping(self) -> bool:
        """Whether it was stopped."""
        return self._stop.is_set()


@dataclass
class _Running:
    job: Job
    timer: bpy.types.Timer
    part: "Future[Any]"
    shown: str = ""


class Slot:
    """Where jobs of one kind go on, one at a time.

    Parameters
    ----------
    reason
        Why there can be no other one meanwhile.
    """

    def __init__(self, reason: str) -> None:
        self.reason = reason
        self.running: _Running | None = None

    def progress(self) -> tuple[float, int, str] | None:
        """How much is done, of how much, and what is going on; None if nothing is."""
        return self.running.job.progress() if self.running else None

    def begin(self, operator: "JobOperator", context: bpy.types.Context, job: Job) -> None:
        """Start a job that the modal operator goes on with."""
        manager = context.window_manager
        timer = manager.event_timer_add(_INTERVAL, window=context.window)
        self.running = _Running(job, timer, _in_thread(job.work))
        manager.progress_begin(0, 100)
        manager.modal_handler_add(operator)
        self.show()

    def show(self) -> None:
        """Tell in the window how far it is."""
        if self.running is None:
            return
        done, total, doing = self.running.job.progress()
        percent = round(100 * done / total)
        text = f"{doing} ({percent}%); Esc: Stop"
        if text != self.running.shown:
            self.running.shown = text
            bpy.context.window_manager.progress_update(percent)
            bpy.context.workspace.status_text_set(text)
            _redraw()

    def end(self) -> None:
        """Stop the job that goes on, and leave the window as it was."""
        if self.running is None:
            return
        running, self.running = self.running, None
        running.job.stop()
        running.part.add_done_callback(lambda _: running.job.close())
        manager = bpy.context.window_manager
        manager.event_timer_remove(running.timer)
        manager.progress_end()
        if bpy.context.workspace:
            bpy.context.workspace.status_text_set(None)
        _redraw()


class JobOperator:
    """Base of operators that do a job."""

    if TYPE_CHECKING:
        report: Callable[..., None]
        poll_message_set: Callable[[str], None]
        properties: bpy.types.OperatorProperties

    slot: ClassVar[Slot]

    def job(self, context: bpy.types.Context) -> Job:
        """The job, checked; raises a DyehouseError if it cannot be done."""
        raise NotImplementedError

    def ended(self, job: Any) -> None:
        """Make what is made of the whole job, and tell it."""
        raise NotImplementedError

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Gray the button out while a job of the kind goes on."""
        if cls.slot.running is not None:
            cls.poll_message_set(cls.slot.reason)
            return False
        return super().poll(context)  # type: ignore[misc]

    @common.reporting
    def execute(self, context: bpy.types.Context) -> None:
        """Do it now."""
        self.at_once(self.job(context))

    @common.reporting
    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Do it while the window goes on."""
        return self.go_on(context, self.job(context))

    def at_once(self, job: Job) -> None:
        """Do a job now."""
        try:
            while job.finish(job.work()):
                pass
            self.ended(job)
        finally:
            job.close()

    def go_on(self, context: bpy.types.Context, job: Job) -> set[str]:
        """Do a job in a thread; at once where there is no window."""
        if bpy.app.background:
            self.at_once(job)
            return {"FINISHED"}
        self.slot.begin(self, context, job)
        return {"RUNNING_MODAL"}

    @common.reporting
    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Show how far it is, and begin the next step."""
        running = self.slot.running
        if running is None:  # the extension was disabled, or another .blend opened
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            running.job.stop()
            self.slot.show()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        self.slot.show()
        if not running.part.done():
            return {"PASS_THROUGH"}
        more = False
        try:
            more = running.job.finish(running.part.result())
            if not more:
                self.ended(running.job)
        except Stopped:
            self.report({"WARNING"}, f"Stopped: {running.job.rest()}")
            return {"CANCELLED"}
        finally:
            if more:
                running.part = _in_thread(running.job.work)
            else:
                self.slot.end()
        return {"PASS_THROUGH"} if more else {"FINISHED"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop because Blender ends or opens another file."""
        self.slot.end()


def _in_thread(function: Callable[[], Any]) -> "Future[Any]":
    from concurrent.futures import Future

    future: Future[Any] = Future()

    def run() -> None:
        try:
            future.set_result(function())
        except Exception as error:  # for Blender's thread
            future.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return future


def _redraw() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions:
                if region.type == _SHOWN_IN.get(area.type):
                    region.tag_redraw()


def registration(slot: Slot, classes: tuple[type, ...]) -> tuple[Callable[[], None], Callable[[], None]]:
    """Functions that offer operators, and that stop what goes on and take them back."""
    register, unregister = bpy.utils.register_classes_factory(classes)

    def stop_and_unregister() -> None:
        slot.end()
        unregister()

    return register, stop_and_unregister
