"""What goes wrong in words: every error that bad input can cause.

Each message is one sentence that names the thing, the problem and the remedy. The front ends show it as it
is: `self.report` in Blender, one line and exit code 2 on the command line.
"""


class DyehouseError(ValueError):
    """Bad input. The message is written for the person who gave it."""


class ImageError(DyehouseError):
    """An array or a decoded picture that cannot be recolored."""


class FileError(DyehouseError):
    """A file that cannot be found, read, understood or written."""


class ReferenceColorError(DyehouseError):
    """A reference pixel or color that cannot stand for the product."""


class WhiteError(DyehouseError):
    """A white that is not one, or that cannot be found."""


class TargetError(DyehouseError):
    """A target color that cannot be understood."""


class MaskError(DyehouseError):
    """A mask that does not fit the picture or leaves nothing of it."""


class RecipeError(DyehouseError):
    """A recipe whose parts do not fit together."""
