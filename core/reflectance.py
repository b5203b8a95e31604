"""The spectral form of the method: geometric coefficients (a, b) from reflectances, and their spread.

Reflectances at a reference position x and at any position y of one material are related by

    R_y(λ) = a R_x(λ) + b + ε(λ)                                                             (15)

with (a, b) depending on geometry alone, so that a target reflectance R'_x gives R'_y = a R'_x + b (20).

The paper's slips, which nothing here repeats:

- (5)-(6): integrating cos θ sin θ against the delta function gives sin(2θ) / 2; "cos 2θ / 2" is printed. It
  is a constant of the photo and drops out of everything after (10).
- (33): the mean of 0..255 is 127.5; 128 is printed. Its term in B is printed bare, which presumes that B has
  taken in W; by (28) it is B W. See `spread_rgb`.
- (35): by (28) and (11) the last term is B W', with W' the response to white under the new light; B W'/W is
  printed, which is right only where W = 1 or, again, where B has taken in W.
- Section 4 says (32) where it means (26).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import ReferenceColorError

# A reference whose spectrum varies by less than this fraction of itself cannot be told from gloss.
_FLAT = 1e-3


def fit(
    reference: ArrayLike, spectra: ArrayLike, weights: ArrayLike | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Geometric coefficients of positions relative to a reference, by weighted least squares (15)-(18).

    This minimizes the sum of w ε² over wavelength. The fit to camera output in (28)-(32) minimizes the square
    of the sum of w ε instead, so the two agree exactly only where ε = 0.

    Parameters
    ----------
    reference
        (n,) reflectance at the reference position, R_x.
    spectra
        (..., n) reflectances at the other positions, R_y. Not finite ones give coefficients that are not
        finite.
    weights
        (n,) weights w(λ) of (18), or (n, m) sensitivities of several sensors, whose squared errors are added:
        the same as giving their sum. None for equal weights, the paper's "conventional" fit.

    Returns
    -------
    a, b
        (...) float64.

    Raises
    ------
    ReferenceColorError
        If the reference spectrum is flat where the weights are, so that a and b cannot be told apart, or not
        finite.
    ValueError
        If shapes do not match, or the weights are negative or all zero.
    """
    x = np.asarray(reference, np.float64)
    y = np.asarray(spectra, np.float64)
    w = np.ones_like(x) if weights is None else np.asarray(weights, np.float64)
    if w.ndim == 2:
        w = w.sum(axis=1)
    if x.ndim != 1 or w.shape != x.shape or y.shape[-1:] != x.shape:
        raise ValueError(
            f"Reference {x.shape}, spectra {y.shape} and weights {w.shape} do not match: give (n,), (..., n) and (n,)."
        )
    if not w.sum() > 0 or w.min() < 0:
        raise ValueError("Weights must not be negative or all zero: give sensitivities or color-matching functions.")
    if not np.isfinite(x).all():
        raise ReferenceColorError("The reference spectrum has missing values: measure it again or interpolate.")
    w = w / w.sum()
    mean = w @ x
    varying = w * (x - mean)
    variance = varying @ x
    if variance <= _FLAT**2 * (w @ x**2):
        raise ReferenceColorError(
            "The reference spectrum is flat, so body color and gloss look alike: take the reference from a "
            "more saturated sample."
        )
    a = y @ varying / variance
    return a, y @ w - a * mean


def predict(a: ArrayLike, b: ArrayLike, target_reference: ArrayLike) -> NDArray[np.float64]:
    """Reflectance of a target material at positions with coefficients (a, b), by (20).

    Parameters
    ----------
    a, b
        (...) coefficients.
    target_reference
        (n,) reflectance of the target material at the reference position.

    Returns
    -------
    (..., n) float64.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    return a[..., None] * np.asarray(target_reference, np.float64) + b[..., None]


def residual(reference: ArrayLike, spectra: ArrayLike, a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """What the model leaves over, ε(λ) of (15): (..., n), positive where the spectrum is above the model."""
    return np.asarray(spectra, np.float64) - predict(a, b, reference)


def _deviations(values: ArrayLike) -> NDArray[np.float64]:
    values = np.asarray(values, np.float64)
    return values - values.mean(axis=0)


def spread(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Bound on the reflectance difference that N objects' coefficients make, the right side of (26).

    Parameters
    ----------
    a, b
        (N, ...) coefficients of the same positions on N objects of one shape.

    Returns
    -------
    (...) float64: the mean over objects of |a - mean a| / 2 + |b - mean b|. It is never less than
    `spread_exact`, and far more where a and b are negatively correlated, as they mostly are.
    """
    return (np.abs(_deviations(a)) / 2 + np.abs(_deviations(b))).mean(axis=0)


def spread_exact(a: ArrayLike, b: ArrayLike) -> NDArray[np.float64]:
    """Expected reflectance difference that N objects' coefficients make, E of (22)-(23).

    The reflectance is equally likely anywhere in 0..1, as for (26), and the integral is exact.

    Parameters
    ----------
    a, b
        (N, ...) coefficients of the same positions on N objects of one shape.

    Returns
    -------
    (...) float64.
    """
    at_0 = _deviations(b)
    at_1 = at_0 + _deviations(a)
    ends = np.abs(at_0) + np.abs(at_1)
    # The integrand is |straight line|: a trapezoid, or two triangles where the line crosses zero.
    squares = at_0**2 + at_1**2
    crossing = np.divide(squares, 2 * ends, out=np.zeros_like(ends), where=ends > 0)
    return np.where(at_0 * at_1 < 0, crossing, ends / 2).mean(axis=0)


def spread_rgb(A: ArrayLike, B: ArrayLike, top: float = 255.0, white: ArrayLike | None = None) -> NDArray[np.float64]:
    """Bound on the difference in camera output that N objects' coefficients make, the right side of (33).

    Parameters
    ----------
    A, B
        (N, ...) coefficients of the same pixels on N objects of one shape.
    top
        The largest output: 255 for the paper's scale, 1 for linear RGB. Output is equally likely anywhere in
        0..top, so its mean is top / 2 (the paper prints 128 for 127.5).
    white
        W, a number or (3,) for the channels, where B is that of (28), as everywhere in this package. None
        where B has taken in W, as the paper prints it.

    Returns
    -------
    (...) float64, or (..., 3) with three whites, on the scale of `top`.
    """
    dA, dB = np.abs(_deviations(A)), np.abs(_deviations(B))
    if white is None:
        return (top / 2 * dA + dB).mean(axis=0)
    W = np.asarray(white, np.float64)
    if W.ndim:
        dA, dB = dA[..., None], dB[..., None]
    return (top / 2 * dA + dB * np.abs(W)).mean(axis=0)
