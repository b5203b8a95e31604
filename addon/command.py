"""`blender --command dyehouse ...`: the command line, inside Blender."""

from typing import Any

import bpy

_handles: list[Any] = []


def _run(arguments: list[str]) -> int:
    from ..batch.cli import main

    return main(arguments)


def register() -> None:
    """Offer the command."""
    _handles.append(bpy.utils.register_cli_command("dyehouse", _run))


def unregister() -> None:
    """Take it back."""
    while _handles:
        bpy.utils.unregister_cli_command(_handles.pop())
