"""The dichromatic reflection model in camera RGB: fit, residual, synthesis, and all of it as one 3x3 matrix.

A pixel of a product is body reflection (light that went into the material and took its color) plus surface
reflection (gloss, the color of the light). With ``V`` the color at a matte reference pixel and ``W`` the response
to a perfect white diffuser under the photo's light, Xin & Shen (2004) write every pixel of the product as

    V_y = A V + B W                        (28)-(31)

and the same pixel of a product of reference color ``V'`` under a light of white ``W'`` as

    V'_y = A V' + B W'                     (34), (35)

Equation (35) is printed with ``B W'/W``. That contradicts (28) and (11), from which it follows: ``B`` multiplies
``W`` in (28), so it multiplies ``W'`` in (35). The printed form is right only for W = (1, 1, 1), or where B has
already absorbed W. The code uses ``B W'``.

Likewise (5) and (6) print cos(2t)/2 for the integral of cos(t) sin(t) against a delta; it is sin(2t)/2. Nothing
here uses it: the factor is the same for every wavelength and cancels in A and B.

``[A B]`` is a fixed 2x3 matrix times the pixel, so fit and synthesis together are one 3x3 matrix; the part of the
pixel that the model does not explain, the residual, is another linear function of it.

References
----------
J. H. Xin and H.-L. Shen, "Accurate color synthesis of three-dimensional objects in an image", J. Opt. Soc. Am. A
21, 713-723 (2004).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import ImageError, ReferenceColorError, TargetError, WhiteError

MODELS = ("dichromatic", "body")

# Angle in degrees, between the white-balanced body colors, over which the residual fades; see carried_residual.
_FADE_ANGLE = 10.0

# Below this sine of the angle between body color and white, float arithmetic itself loses the fit.
_SMALLEST_SINE = 1e-4


def as_white(white: ArrayLike | None) -> NDArray[np.float64]:
    """Check a white: (3,), finite and above zero; None is (1, 1, 1), a photo that is white-balanced already.

    Raises
    ------
    WhiteError
        If it is anything else.
    """
    if white is None:
        return np.ones(3)
    w = _triple(white, WhiteError, "White")
    if (w <= 0).any():
        raise WhiteError(
            f"White {_show(w)} has a channel that is zero or negative: pick a white or grey card that is lit and "
            "not clipped to a color."
        )
    return w


def as_reference(reference: ArrayLike) -> NDArray[np.float64]:
    """Check a reference color: (3,), finite, not black.

    Raises
    ------
    ReferenceColorError
        If it is anything else.
    """
    v = _triple(reference, ReferenceColorError, "Reference color")
    if v.max() <= 0:
        raise ReferenceColorError(f"Reference color {_show(v)} is black: pick a lit, matte part of the product.")
    return v


def as_target(target: ArrayLike) -> NDArray[np.float64]:
    """Check a target color: (3,) linear RGB, finite. Channels below zero are allowed: saturated colors have them.

    Raises
    ------
    TargetError
        If it is anything else.
    """
    return _triple(target, TargetError, "Target color")


def _triple(value: ArrayLike, error: type[ValueError], what: str) -> NDArray[np.float64]:
    try:
        v = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise error(f"{what} {value!r} is not three numbers: give linear red, green and blue.") from None
    if v.shape != (3,):
        raise error(f"{what} has shape {v.shape}: give three numbers, linear red, green and blue.")
    if not np.isfinite(v).all():
        raise error(f"{what} {_show(v)} is not finite: give three ordinary numbers.")
    return v


def _show(v: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in v) + ")"


def sine(reference: ArrayLike, white: ArrayLike | None = None) -> float:
    """Sine of the angle between body color and white, each channel taken relative to the white.

    It is the number that decides whether body and surface reflection can be told apart: 0 for a grey product.
    """
    v = as_reference(reference) / as_white(white)
    grey = v.mean()
    return float(np.linalg.norm(v - grey) / np.linalg.norm(v))


def projector(reference: ArrayLike, white: ArrayLike | None = None, model: str = "dichromatic") -> NDArray[np.float64]:
    """Build the matrix P that turns a pixel into its coefficients, ``[A, B] = P @ pixel``; Eqs. (28)-(31).

    Parameters
    ----------
    reference
        (3,) linear RGB of the product at the reference pixel, V.
    white
        (3,) linear RGB of a perfect white diffuser under the photo's light, W; None for ones.
    model
        "dichromatic": least squares over both terms, the pseudoinverse of [V W]. "body": body reflection alone,
        B is 0 everywhere.

    Returns
    -------
    (2, 3) float64.

    Raises
    ------
    ReferenceColorError
        If the reference is black, or (dichromatic) has the color of the white, which leaves A and B undefined.
    WhiteError
        If a channel of the white is not above zero.
    """
    v, w = as_reference(reference), as_white(white)
    if model == "body":
        return np.vstack([v / (v @ v), np.zeros(3)])
    if model != "dichromatic":
        raise ImageError(f"Model '{model}' is not known: use one of auto, {', '.join(MODELS)}.")
    if sine(v, w) < _SMALLEST_SINE:
        raise ReferenceColorError(
            f"Reference color {_show(v)} is the color of the white {_show(w)}: body and surface reflection cannot "
            "be told apart; use the model 'body', or pick a colored part of the product."
        )
    return np.linalg.pinv(np.column_stack([v, w]))


def fit(
    pixels: ArrayLike, reference: ArrayLike, white: ArrayLike | None = None, model: str = "dichromatic"
) -> tuple[NDArray, NDArray]:
    """Coefficients (A, B) of every pixel; Eqs. (28)-(31).

    Parameters
    ----------
    pixels
        (..., 3) linear RGB of any float dtype.
    reference, white, model
        As for :func:`projector`.

    Returns
    -------
    A, B : (...) arrays of the pixels' dtype (float64 unless they are float32)
        A is 1 and B is 0 at the reference. Neither is clamped: B is below zero where the reference holds more
        gloss than the pixel, and clamping it there ruins the picture.
    """
    p = projector(reference, white, model)
    x = _floats(pixels)
    coefficients = x @ p.T.astype(x.dtype)
    return coefficients[..., 0], coefficients[..., 1]


def synthesize(A: ArrayLike, B: ArrayLike, target: ArrayLike, target_white: ArrayLike | None = None) -> NDArray:
    """Pixels of another body color and light from coefficients: ``A V' + B W'``; Eq. (35), corrected.

    Parameters
    ----------
    A, B
        Arrays of one shape.
    target
        (3,) linear RGB at the reference, V', under the new light.
    target_white
        (3,) white W' of the new light; None for ones.

    Returns
    -------
    (..., 3) array.
    """
    a, b = np.asarray(A), np.asarray(B)
    dtype = np.result_type(a, b, np.float32)
    v, w = as_target(target).astype(dtype), as_white(target_white).astype(dtype)
    return a[..., None] * v + b[..., None] * w


def residual(
    pixels: ArrayLike, reference: ArrayLike, white: ArrayLike | None = None, model: str = "dichromatic"
) -> NDArray:
    """Distance of every pixel from the model, the Euclidean norm over the channels; Eq. (32).

    Returns
    -------
    (...) array, >= 0, in the unit of the pixels. The paper states it on a scale of 0..255.
    """
    x = _floats(pixels)
    q = residual_projector(reference, white, model).astype(x.dtype)
    return np.linalg.norm(x @ q.T, axis=-1)


def residual_projector(
    reference: ArrayLike, white: ArrayLike | None = None, model: str = "dichromatic"
) -> NDArray[np.float64]:
    """(3, 3) matrix Q that leaves of a pixel what the model does not explain: ``Q @ pixel = pixel - A V - B W``."""
    v, w = as_reference(reference), as_white(white)
    return np.eye(3) - np.column_stack([v, w]) @ projector(v, w, model)


def recolor_matrix(
    reference: ArrayLike,
    target: ArrayLike,
    white: ArrayLike | None = None,
    target_white: ArrayLike | None = None,
    model: str = "dichromatic",
    residual: float = 0.0,
) -> NDArray[np.float64]:
    """Fit and synthesis as one matrix: ``pixel' = M @ pixel``, ``M = [V' W'] P + r D Q``.

    Parameters
    ----------
    reference
        (3,) linear RGB of the product at the reference pixel, V.
    target
        (3,) linear RGB that this pixel shall have, V', under the new light.
    white, target_white
        (3,) whites W and W' of the old and the new light; None for ones, and None for an unchanged light.
    model
        "dichromatic" or "body".
    residual
        Share r of the residual that is carried over: 0 drops it, 1 keeps it. ``D = diag(W'/W)`` puts it under the
        new light. :func:`carried_residual` gives the house rule.

    Returns
    -------
    (3, 3) float64. With r = 0 it equals :func:`fit` followed by :func:`synthesize`; with r = 1 and unchanged
    colors it is the identity.
    """
    w = as_white(white)
    w2 = w if target_white is None else as_white(target_white)
    v, v2 = as_reference(reference), as_target(target)
    matrix = np.column_stack([v2, w2]) @ projector(v, w, model)
    if residual:
        matrix = matrix + residual * (w2 / w)[:, None] * residual_projector(v, w, model)
    return matrix


def carried_residual(
    reference: ArrayLike,
    target: ArrayLike,
    white: ArrayLike | None = None,
    target_white: ArrayLike | None = None,
) -> float:
    """Share of the residual that goes over to a new color: the house rule, found by measurement.

    Returns
    -------
    float in 0..1: 1 at the product's own color.
    """
    w = as_white(white)
    w2 = w if target_white is None else as_white(target_white)
    v, v2 = as_reference(reference) / w, as_target(target) / w2
    length = float(np.linalg.norm(v2))
    if length == 0:
        return 0.0
    cosine = float(v @ v2) / (float(np.linalg.norm(v)) * length)
    angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    return float(np.exp(-((angle / _FADE_ANGLE) ** 2)) * min(1.0, length / float(np.linalg.norm(v))))


def residual_share(
    rule: str | float,
    reference: ArrayLike,
    target: ArrayLike,
    white: ArrayLike | None = None,
    target_white: ArrayLike | None = None,
) -> float:
    """Turn the user's choice for the residual into a share: "fade", "keep", "drop", or a number in 0..1.

    Raises
    ------
    TargetError
        If it is none of these.
    """
    if isinstance(rule, str):
        if rule == "fade":
            return carried_residual(reference, target, white, target_white)
        if rule in ("keep", "drop"):
            return 1.0 if rule == "keep" else 0.0
    elif 0 <= rule <= 1:
        return float(rule)
    raise TargetError(f"Residual rule {rule!r} is not known: use fade, keep, drop, or a share from 0 to 1.")


def _floats(pixels: ArrayLike) -> NDArray:
    x = np.asarray(pixels)
    if x.ndim < 1 or x.shape[-1] != 3:
        raise ImageError(f"Picture has shape {x.shape}: its last axis must be red, green, blue.")
    return x if x.dtype in (np.float32, np.float64) else x.astype(np.float64 if x.dtype != np.float16 else np.float32)
