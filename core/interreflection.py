"""Light that met the product more than once: deep folds, the inside of a cup.

A surface of reflectance ``rho`` that lights itself sends out, besides ``rho`` times the light of the lamps, ``rho**2``
times what it got from its neighbor, ``rho**3`` and so on. With a constant share K of every reflection coming back,
the part beyond the first is in proportion to

    rho**2 / (1 - K rho)

in every channel (Koenderink & van Doorn 1983; Nayar, Ikeuchi & Kanade 1991). It is more saturated than the body, so
that the dichromatic model takes it for gloss below zero. Channels are treated as narrow bands, in which the
reflectance is constant; on the spectral renders of the laboratory that is near enough, see docs/models.md.

References
----------
J. J. Koenderink and A. J. van Doorn, "Geometrical modes as a general method to treat diffuse interreflections in
radiometry", J. Opt. Soc. Am. 73, 843-850 (1983).
S. K. Nayar, K. Ikeuchi and T. Kanade, "Shape from interreflections", Int. J. Comput. Vision 6, 173-195 (1991).
B. V. Funt and M. S. Drew, "Color space analysis of mutual illumination", IEEE Trans. Pattern Anal. Mach. Intell. 15,
1319-1326 (1993).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Share K of the light that comes back, over the exposure of the reference: what the folds of the laboratory have, and
# where the search for it starts.
USUAL = 0.55

# K rho is held below this: beyond, the sum of all bounces is a guess.
_MOST = 0.9


_CANDIDATES = 2.0 ** np.linspace(-2.5, 2.5, 21)


def bounced(body: ArrayLike, feedback: float) -> NDArray[np.float64]:
    """Color of the light that met the surface at least twice, ``rho**2 / (1 - K rho)``.

    Parameters
    ----------
    body
        (3,) body color relative to the white. Channels below zero count as zero.
    feedback
        K, >= 0.

    Returns
    -------
    (3,) float64, relative to the white.
    """
    rho = np.maximum(np.asarray(body, np.float64), 0.0)
    return rho**2 / (1 - np.minimum(feedback * rho, _MOST))


def unbounced(color: ArrayLike, bounce: float, light: float = 1.0, feedback: float = USUAL) -> NDArray[np.float64]:
    """Body color in so much light of which a color is the sum with so much bounce; the inverse of :func:`bounced`.

    Parameters
    ----------
    color
        (3,) relative to the white.
    bounce, light
        Of ``light * v + bounce * bounced(v)``; >= 0 and > 0.
    feedback
        K, >= 0.

    Returns
    -------
    (3,) float64 ``light * v``, relative to the white.
    """
    c = np.asarray(color, np.float64)
    straight = light + feedback * c
    v = 2 * c / (straight + np.sqrt(np.maximum(straight**2 + 4 * (bounce - light * feedback) * c, 0.0)))
    return np.where(c > 0, light * v, c)


def find_feedback(pixels: NDArray, body: NDArray, noise: NDArray, most: float = 1000, usual: float = USUAL) -> float:
    """Find K of a matte product from the colors of its folds.

    With the right K all pixels lie in the plane of the body color and its bounce. An exposure that is unknown, so that
    the body color is the reflectance times a factor, is found along with it.

    Parameters
    ----------
    pixels
        (n, 3) relative to the white and, each, to its brightness along the body color.
    body
        (3,) relative to the white.
    noise
        (n,) standard deviation of the pixels.
    most
        Number of pixels that count as independent of each other: what the model misses, it misses in all of a fold.
    usual
        K to expect.

    Returns
    -------
    K; the usual one where the pixels do not tell.
    """
    best, least = usual, np.inf
    for k in usual * _CANDIDATES:
        if k * body.max() > _MOST:
            break
        normal = np.cross(body, bounced(body, k))
        length = float(np.linalg.norm(normal))
        if length < 1e-9:
            return usual
        # Errors beyond three deviations are something else than folds.
        left = most * np.minimum((pixels @ (normal / length) / noise) ** 2, 9.0).mean()
        cost = float(left + np.log2(k / usual) ** 2)
        if cost < least:
            best, least = float(k), cost
    return best
