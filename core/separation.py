"""Body, gloss and bounce told apart pixel by pixel, as well as the noise allows.

Beside its light along the body color, a pixel has two numbers: its color across it. Gloss moves them toward the white,
bounced light away from it. Where the photo is noisy, or the product almost grey, single pixels do not tell; what is
done about it, in this order:

1. The color across is smoothed under the guidance of the light along, which carries shading and texture at little
   noise (He, Sun & Tang 2013, on a coarse grid as in He & Sun 2015). What leaves the smooth by more than noise does
   is kept (Lee 1980).
2. B and C are the most probable ones: Gaussian noise, and a prior that allows any gloss above zero, hardly any
   below, and a bounce of the size that folds have. Each weighs by the noise of the pixel, so that what is poorly
   determined shrinks to none, and nothing changes where the noise is small.
3. Gloss and bounce move the color in almost opposite directions on a pale product, so that noise makes both where
   there is neither. Each is held against its own size (the nonnegative garrote, Breiman 1995), and what then makes up
   for the other is none.

The light along the body color is never touched: shading and texture stay as they are.

References
----------
K. He, J. Sun and X. Tang, "Guided image filtering", IEEE Trans. Pattern Anal. Mach. Intell. 35, 1397-1409 (2013).
K. He and J. Sun, "Fast guided filter", arXiv:1505.00996 (2015).
J.-S. Lee, "Digital image enhancement and noise filtering by use of local statistics", IEEE Trans. Pattern Anal. Mach.
Intell. 2, 165-168 (1980).
L. Breiman, "Better subset regression using the nonnegative garrote", Technometrics 37, 373-384 (1995).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .interreflection import USUAL, bounced

# What the model itself is wrong by, as a share of a pixel's light: it counts as noise.
MODEL_ERROR = 0.003

# Widths of the priors: gloss above and below zero, as shares of the light; bounce above and below zero, in units of
# the body's light at the usual exposure.
_GLOSS, NO_GLOSS = 1.0, 0.02
USUAL_BOUNCE, _NO_BOUNCE = 0.3, 0.05

# Variances of the noise that the square of gloss or bounce is held against where the pixel shows both.
_DOUBT = 2.5


@dataclass(frozen=True)
class Frame:
    """Axes of color for one body color, all relative to the white.

    Attributes
    ----------
    along
        (3,) unit vector of the body color.
    across
        (2, 3) unit vectors at right angles to it; the first toward white.
    length
        Of the body color.
    white, bounce
        (3,) the white and the bounce along these three axes.
    exposure
        How many times the light of the body color that is in which K is the usual one: it scales the bounce.
    """

    along: NDArray[np.float64]
    across: NDArray[np.float64]
    length: float
    white: tuple[float, ...]
    bounce: tuple[float, ...]
    exposure: float = 1.0


def frame(body: NDArray, feedback: float = 0.0) -> Frame:
    """Axes for a body color (3,), relative to the white."""
    length = float(np.linalg.norm(body))
    along = body / length
    toward = 1 - along.sum() * along
    size = float(np.linalg.norm(toward))
    if size < 1e-6:  # grey: any direction across will do, there is no gloss to be seen in it
        toward = np.cross(along, [1.0, -1.0, 0.0])
        size = float(np.linalg.norm(toward))
    first = toward / size
    axes = np.stack([along, first, np.cross(along, first)])
    white, bounce = ((axes @ color).tolist() for color in (np.ones(3), bounced(body, feedback)))
    return Frame(along, axes[1:], length, tuple(white), tuple(bounce), feedback / USUAL or 1.0)


def split(
    light: NDArray,
    across: NDArray,
    variance: NDArray,
    axes: Frame,
    bounce: bool,
    gloss: bool = True,
    below: float = NO_GLOSS,
    doubted: bool = False,
) -> tuple[NDArray, NDArray, NDArray]:
    """Most probable gloss and bounce of pixels.

    The sum of squares is convex, with a kink in its slope where B or C is zero: of the four quadratics the one whose
    solution lies on its own side is the solution, and it moves continuously with the pixel.

    Parameters
    ----------
    light
        (...) along the body color, above zero.
    across
        (2, ...) color across it.
    variance
        (...) of the noise in it.
    axes
        The frame.
    bounce, gloss
        Whether there is any of each.
    below
        Width of the prior of gloss below zero, as a share of the light.
    doubted
        Whether gloss and bounce in one pixel may be noise that makes up for each other.

    Returns
    -------
    B, C
        (...) gloss and bounce.
    left
        (...) square of what is left over, in units of the variance.
    """
    total = variance + (MODEL_ERROR * light) ** 2
    (e1, e2), (f1, f2) = axes.white[1:], axes.bounce[1:]
    y1, y2 = across
    shine, folded = total / light**2, total / (light * (axes.exposure / axes.length)) ** 2
    r1, r2 = e1 * y1 + e2 * y2, f1 * y1 + f2 * y2
    b, c = np.zeros_like(light), np.zeros_like(light)
    if gloss and bounce:
        a12 = e1 * f1 + e2 * f2
        for width_b, above_b in ((_GLOSS, True), (below, False)):
            a11 = e1 * e1 + e2 * e2 + shine / width_b**2
            for width_c, above_c in ((USUAL_BOUNCE, True), (_NO_BOUNCE, False)):
                a22 = f1 * f1 + f2 * f2 + folded / width_c**2
                scale = 1 / (a11 * a22 - a12 * a12)
                b_here, c_here = (a22 * r1 - a12 * r2) * scale, (a11 * r2 - a12 * r1) * scale
                own = ((b_here >= 0) == above_b) & ((c_here >= 0) == above_c)
                np.copyto(b, b_here, where=own)
                np.copyto(c, c_here, where=own)
    elif gloss:
        b = r1 / (e1 * e1 + e2 * e2 + shine * np.where(r1 >= 0, _GLOSS**-2, below**-2).astype(light.dtype))
    elif bounce:
        c = r2 / (f1 * f1 + f2 * f2 + folded * np.where(r2 >= 0, USUAL_BOUNCE**-2, _NO_BOUNCE**-2).astype(light.dtype))
    left = ((y1 - e1 * b - f1 * c) ** 2 + (y2 - e2 * b - f2 * c) ** 2) / total
    if gloss:  # what single pixels do not prove is none
        if doubted and bounce:
            normal = e1 * e1 + e2 * e2, f1 * f1 + f2 * f2
            b, c = _garrote((b, c), (r1, r2), _DOUBT * variance, normal, e1 * f1 + e2 * f2)
        else:
            b *= np.maximum(0.0, 1 - 4 * variance / np.maximum(axes.white[1] ** 2 * b * b, 1e-30))
        np.minimum(b, light / axes.white[0], out=b)  # no more gloss than light
    return b, c, left


def _garrote(
    found: tuple[NDArray, NDArray],
    products: tuple[NDArray, NDArray],
    doubt: NDArray,
    squares: tuple[float, float],
    product: float,
) -> tuple[NDArray, NDArray]:
    """Gloss and bounce with a price on each that falls with its size, and no less than zero of what was above it.

    Parameters
    ----------
    found
        Gloss and bounce without a price.
    products
        Of the color across with the directions of both.
    doubt
        Price, times what it is put on.
    squares, product
        Of the directions: the normal equations of the split.
    """
    prices = [doubt / np.maximum(k, 1e-9) for k in found]
    p1, p2 = (p - price for p, price in zip(products, prices, strict=True))
    scale = 1 / max(squares[0] * squares[1] - product**2, 1e-12)
    both = (squares[1] * p1 - product * p2) * scale, (squares[0] * p2 - product * p1) * scale
    alone = np.maximum(p1 / squares[0], 0), np.maximum(p2 / squares[1], 0)
    needed = (both[0] > 0) & (both[1] > 0)
    no_gloss = p1 <= product * alone[1]
    priced = np.where(needed, both[0], ~no_gloss * alone[0]), np.where(needed, both[1], no_gloss * alone[1])
    seen = (found[0] > 0) & (found[1] > 0)
    single = (
        np.where(k > 0, np.maximum(k - price / a, 0), k) for k, price, a in zip(found, prices, squares, strict=True)
    )
    b, c = (np.where(seen, p, k) for p, k in zip(priced, single, strict=True))
    return b, c
