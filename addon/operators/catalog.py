"""Checking and running a catalog: the same as `dyehouse batch`, while the window goes on."""

from typing import Any

import bpy
from bpy.props import EnumProperty, FloatProperty, StringProperty

from .. import catalog, properties
from . import common, modal

_SLOT = modal.Slot("A catalog is at work; Esc stops it")
progress = _SLOT.progress

# What came of the catalog that was checked or run last.
_last: list[catalog.Outcome] = []


def outcome() -> catalog.Outcome | None:
    """What came of the catalog that was checked or run last in this session."""
    return _last[0] if _last else None


class _Job(modal.Job):
    """One run of `dyehouse batch` with these arguments, of which the first is the recipe or the table."""

    def __init__(self, arguments: list[str]) -> None:
        super().__init__()
        self._arguments = arguments
        self._done, self._total = 0, 0
        self._child: catalog.Child | None = None
        _last.clear()

    def work(self) -> catalog.Outcome:
        """Run it, and count its results."""
        if "--check" not in self._arguments:
            self._total = catalog.results(self._arguments[0])
        self.watch(0)
        self._child = catalog.Child("batch", *self._arguments, "--json")
        if self.stopping:
            self._child.stop()
        found = self._child.outcome(self._note)
        if found is not None:
            _last[:] = [found]
        if found is None or self.stopping:
            raise modal.Stopped
        return found

    def finish(self, made: catalog.Outcome) -> bool:
        """There is one step."""
        return False

    def stop(self) -> None:
        """Begin no other photo."""
        super().stop()
        if self._child:
            self._child.stop()

    def progress(self) -> tuple[float, int, str]:
        """How many results there are, of how many."""
        if not self._total:
            return 0, 1, "Stopping" if self.stopping else "Checking Catalog"
        doing = "Finishing Photos" if self.stopping else f"Catalog, {self._done} of {self._total}"
        return self._done, self._total, doing

    def rest(self) -> str:
        """What was done."""
        return f"{_last[0].sentence}; Resume goes on" if _last else "nothing written"

    def _note(self) -> None:
        self._done += 1


class _Catalog(modal.JobOperator):
    """Base of operators about a catalog. What is not given is as in the scene's settings."""

    slot = _SLOT

    jobs: StringProperty(
        name="Recipe or Table",
        description="Recipe (.toml) or table (.csv, .tsv, .jsonl) of the catalog; empty for the scene's",
        options=common.PATH,
    )
    output: StringProperty(
        name="Output", description="Folder of the results; empty for the scene's", options=common.PATH
    )
    existing: EnumProperty(name="Earlier Results", items=properties.EXISTING, options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        """Gray the button out while there is nothing to do."""
        if cls.slot.running is not None:
            cls.poll_message_set(cls.slot.reason)
            return False
        asked = context.scene and context.scene.dyehouse_catalog
        if context.area and asked and not (asked.jobs and asked.output):
            cls.poll_message_set("Choose a recipe or a table, and a folder for the results")
            return False
        return True

    def arguments(self, context: bpy.types.Context) -> list[str]:
        """Of `dyehouse batch`.

        Raises
        ------
        RecipeError
            If there is no table, or no folder.
        """
        from ...core.errors import RecipeError

        asked = context.scene.dyehouse_catalog
        jobs, output = self.jobs or asked.jobs, self.output or asked.output
        if not (jobs and output):
            raise RecipeError("A catalog needs a recipe or a table, and a folder for the results: choose them.")
        existing = self.existing if self.properties.is_property_set("existing") else asked.existing
        found = [str(common.absolute(jobs)), "--out", str(common.absolute(output))]
        return found + ([] if existing == "KEEP" else [f"--{existing.lower()}"])

    def ended(self, job: Any) -> None:
        """Tell what came of it."""
        from ...core.errors import RecipeError

        (found,) = _last
        if not found.summary:
            raise RecipeError("\n".join([found.sentence, *found.named]))
        for problem in found.named:
            self.report({"WARNING"}, problem)
        self.report({"INFO"}, found.sentence)


class DYEHOUSE_OT_check_batch(_Catalog, bpy.types.Operator):
    """Check the catalog and all files that it names; nothing is written"""

    bl_idname = "dyehouse.check_batch"
    bl_label = "Check"
    bl_options = {"REGISTER"}

    def job(self, context):
        """Of the check."""
        return _Job([*self.arguments(context), "--check"])


class DYEHOUSE_OT_run_batch(_Catalog, bpy.types.Operator):
    """Put all photos of the catalog into their colorways; Esc stops after the photos that are under way"""

    bl_idname = "dyehouse.run_batch"
    bl_label = "Run"
    bl_options = {"REGISTER"}

    max_error: FloatProperty(
        name="Largest Error",
        description="Predicted CIEDE2000 above which a result is set aside for a person; 0 for the scene's",
        min=0,
        options={"SKIP_SAVE"},
    )

    def job(self, context):
        """Of the run."""
        largest = self.max_error or context.scene.dyehouse_catalog.max_error
        return _Job([*self.arguments(context), *(["--max-error", f"{largest:g}"] if largest else [])])


CLASSES = (DYEHOUSE_OT_check_batch, DYEHOUSE_OT_run_batch)
register, unregister = modal.registration(_SLOT, CLASSES)
