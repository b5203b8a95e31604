"""Put a product into any color, accurately.

`dyehouse.core` is the method and needs numpy only; `dyehouse.batch` works on files; `dyehouse.addon` is the
Blender extension, which Blender starts through the two functions below.
"""


def register() -> None:
    """Start the extension (called by Blender)."""
    from . import addon

    addon.register()


def unregister() -> None:
    """Stop the extension (called by Blender)."""
    from . import addon

    addon.unregister()
