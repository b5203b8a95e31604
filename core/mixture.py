"""What the pixels of a product are mixed from: the terms of a model, and its matrix for any target.

Every model here says: a pixel is a sum of a few colors (the terms), each of which is known for any body color and
any light, times coefficients that belong to the place and stay. The coefficients are linear in the pixel and, where
that is not enough, in a few correction maps that are made once for the photo. So a recolor is always one matrix.

==============  ======================  ====================================================================
model           terms                   for
==============  ======================  ====================================================================
"body"          V                       products of the color of the light
"dichromatic"   V, W                    Xin & Shen (2004), Eq. (28)
"regularized"   V, W                    the same where noise is not small: B is smoothed and shrunk, see
                                        `separation`
"bounce"        V, bounce (, W)         folds, see `interreflection`; matte products by a matrix alone, glossy
                                        ones with maps
"lights"        V, W, V l               two lights of different color, l their ratio
"metal"         V by channel            reflects its surroundings, each channel times its own reflectance
==============  ======================  ====================================================================
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from . import dichromatic
from .interreflection import bounced

MODELS = ("dichromatic", "body", "regularized", "bounce", "lights", "metal")


@dataclass(frozen=True, eq=False)
class Mixture:
    """One model of one region.

    Attributes
    ----------
    model
        One of `MODELS`.
    body, white
        (3,) linear RGB: body color V and white W.
    terms
        Names of the colors that are mixed: "body", "white", "bounce", "light"; or "red", "green", "blue" for a
        body color by channel.
    projector
        (m, 3 + n): coefficients of the terms from the pixel and the n corrections.
    feedback
        K of the bounce.
    light
        (3,) color of a second light, relative to the first.
    """

    model: str
    body: NDArray[np.float64]
    white: NDArray[np.float64]
    terms: tuple[str, ...]
    projector: NDArray[np.float64]
    feedback: float = 0.0
    light: NDArray[np.float64] = field(default_factory=lambda: np.ones(3))

    def colors(self, body: NDArray, white: NDArray) -> NDArray[np.float64]:
        """(3, m) linear RGB of the terms, for any body color and white."""
        if self.terms == ("red", "green", "blue"):
            return np.diag(body)
        known = {
            "body": body,
            "white": white,
            "bounce": bounced(body / white, self.feedback) * white,
            "light": body * self.light,
        }
        return np.column_stack([known[term] for term in self.terms])

    @property
    def keeps_white(self) -> bool:
        """Whether light of the white's color, such as a neutral ground, stays as it is."""
        return self.model != "body" and "white" in self.terms

    @property
    def left_over(self) -> NDArray[np.float64]:
        """(3, 3 + n) matrix that leaves of a pixel what the model does not explain."""
        return np.eye(3, self.projector.shape[1]) - self.colors(self.body, self.white) @ self.projector

    def matrix(self, target: NDArray, target_white: NDArray, residual: float) -> NDArray[np.float64]:
        """(3, 3 + n) recolor matrix: ``C' P + r D (I - C P)``, see :func:`dichromatic.recolor_matrix`."""
        made = self.colors(target, target_white) @ self.projector
        if residual:
            made = made + residual * (target_white / self.white)[:, None] * self.left_over
        return made

    def coefficient(self, term: str) -> NDArray[np.float64]:
        """(3 + n,) row of the projector that gives a term's coefficient; zeros if the model has no such term."""
        if self.terms == ("red", "green", "blue"):
            return self.projector.mean(axis=0) if term == "body" else np.zeros(self.projector.shape[1])
        if term not in self.terms:
            return np.zeros(self.projector.shape[1])
        return self.projector[self.terms.index(term)]


def plain(model: str, body: NDArray, white: NDArray) -> Mixture:
    """The models "body" and "dichromatic"."""
    projector = dichromatic.projector(body, white, model)
    return Mixture(model, body, white, ("body", "white"), projector)


def matte_bounce(body: NDArray, white: NDArray, feedback: float) -> Mixture:
    """A matte product in folds: body and bounce, by a matrix alone."""
    colors = np.column_stack([body / white, bounced(body / white, feedback)])
    projector = np.linalg.pinv(colors) / white
    return Mixture("bounce", body, white, ("body", "bounce"), projector, feedback)


def two_lights(body: NDArray, white: NDArray, light: NDArray) -> Mixture:
    """A product between two lights: its body color in each, and gloss."""
    projector = np.linalg.inv(np.column_stack([body, white, body * light]))
    return Mixture("lights", body, white, ("body", "white", "light"), projector, light=light)


def metal(body: NDArray, white: NDArray) -> Mixture:
    """A metal: every channel of what it reflects times its own reflectance."""
    floor = 1e-3 * float(np.abs(body).max())
    safe = np.where(np.abs(body) < floor, floor, body)
    return Mixture("metal", body, white, ("red", "green", "blue"), np.diag(1 / safe))


def mapped(model: str, body: NDArray, white: NDArray, feedback: float = 0.0, gloss: bool = True) -> Mixture:
    """The models whose coefficients B (with gloss) and C (of the bounce) are maps; A is what they leave of the light.

    The corrections are B and C, as far as the model has them, in this order.
    """
    v = body / white
    towards = v / (v @ v)
    terms = ["body", *(["white"] if gloss else []), *(["bounce"] if model == "bounce" else [])]
    mixture = Mixture(model, body, white, tuple(terms), np.zeros((len(terms), 3)), feedback)
    colors = mixture.colors(body, white) / white[:, None]
    projector = np.zeros((len(terms), 3 + len(terms) - 1))
    projector[0, :3] = towards / white
    projector[0, 3:] = -(towards @ colors[:, 1:])
    projector[1:, 3:] = np.eye(len(terms) - 1)
    return Mixture(model, body, white, tuple(terms), projector, feedback)
