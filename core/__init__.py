"""The method: numpy and nothing else.

from dyehouse.core import analyze

analysis = analyze(image, white=W, reference=(x, y), mask=mask)
image2 = analysis.recolor(target)
"""

from .analysis import Analysis, analyze
from .errors import DyehouseError
from .picture import Picture

__all__ = ["Analysis", "DyehouseError", "Picture", "analyze"]
