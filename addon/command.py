"""`blender --command dyehouse ...`: the command line, inside Blender."""

import sys
from typing import Any

import bpy

_handles: list[Any] = []


def _run(arguments: list[str]) -> int:
    from ..batch.cli import main

    try:
        return main(arguments)
    except ModuleNotFoundError as error:
        if error.name != "OpenImageIO":
            raise
        print(
            "dyehouse: The command line reads pictures by OpenImageIO, which this Blender does not have: use a Blender "
            "of blender.org, or the operators (bpy.ops.dyehouse), which can do without.",
            file=sys.stderr,
        )
        return 2


def register() -> None:
    """Offer the command."""
    _handles.append(bpy.utils.register_cli_command("dyehouse", _run))


def unregister() -> None:
    """Take it back."""
    while _handles:
        bpy.utils.unregister_cli_command(_handles.pop())
