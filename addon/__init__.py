"""The Blender side: everything that touches bpy, and nothing else."""

from . import command

_PARTS = (command,)


def register() -> None:
    """Register every part, in order."""
    for part in _PARTS:
        part.register()


def unregister() -> None:
    """Unregister every part, in reverse order."""
    for part in reversed(_PARTS):
        part.unregister()
