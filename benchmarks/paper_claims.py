"""What the paper says, in its numbers and in its sentences, and whether the laboratory finds the same.

Tables are those of Xin & Shen (2004): rows are positions 1-2 to 1-5, columns the pairs of the first, second, ...
object.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .paper_pictures import OURS, Regions, Synthesis, Variation, pooled
from .paper_tables import Objects

TABLE_1 = np.array(
    [
        [0.066, 0.219, 0.106, 0.107],
        [0.132, 0.239, 0.135, 0.158],
        [0.226, 0.329, 0.250, 0.475],
        [0.437, 0.456, 1.043, 1.752],
    ]
)
"""CMC(1:1), plastic, measured blue cup against synthesized; pairs of the blue, green, red and yellow cups."""

TABLE_2 = np.array([[0.269, 0.601, 0.335], [0.294, 1.035, 0.302], [0.398, 1.210, 0.501], [0.915, 2.280, 1.706]])
"""CMC(1:1), three fabrics."""

TABLE_3 = {"plastic": np.array([0.0025, 0.0030, 0.0063, 0.0094]), "fabric": np.array([0.0068, 0.0105, 0.0080, 0.0104])}
"""E of (26) at positions 1-2 to 1-5."""

RESIDUAL = 0.27
"""Mean residual of the plastic cup, (32), on the scale of 0..255; section 4."""

VARIATION = 6.0
"""E_V of (33) over four cups, "~6.0", on the scale of 0..255; section 4."""

LIMIT = 0.02
"""Of E: "expected to be lower than 2% in most cases"; section 4."""


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper.

    Attributes
    ----------
    text
        What it says.
    holds
        Whether the laboratory agrees.
    found
        What the laboratory measures.
    """

    text: str
    holds: bool
    found: str


def own_pair_is_best(*groups: Objects) -> Claim:
    """Section 4: the pair that was solved from the object itself gives the lowest difference."""
    count = total = 0
    for objects in groups:
        table = objects.differences[:, 0, 1:5]
        count += int((table.argmin(axis=0) == 0).sum())
        total += table.shape[1]
    return Claim("An object's own pair gives the lowest difference", count == total, f"at {count} of {total} positions")


def last_position_is_worst(*groups: Objects) -> Claim:
    """Section 4: position 5 reflects least and has the highest difference."""
    found = [objects.differences[:, 0, 1:5].argmax(axis=1) == 3 for objects in groups]
    every = np.concatenate(found)
    return Claim(
        "The darkest position, 5, has the highest difference", bool(every.all()), f"{every.sum()} of {every.size} pairs"
    )


def variation_is_small(plastic: Objects, fabric: Objects) -> Claim:
    """Section 4: E is lower than 2% in most cases."""
    shares = [float((objects.spread_map < LIMIT).mean()) for objects in (plastic, fabric)]
    worst = [float(objects.spread[1:5].max()) for objects in (plastic, fabric)]
    return Claim(
        "E of (26) is below 2 % in most cases",
        min(shares) > 0.5 and max(worst) < LIMIT,
        f"plastic: at most {worst[0]:.2%} at the positions, below 2 % at {shares[0]:.1%} of all pixels; "
        f"fabric: {worst[1]:.2%}, {shares[1]:.1%}",
    )


def bound_is_upper_limit(plastic: Objects, fabric: Objects) -> Claim:
    """Section 4: the actual difference is always smaller than (26), as a and b are negatively correlated."""
    both = [(objects.spread_exact[1:5], objects.spread[1:5]) for objects in (plastic, fabric)]
    ratio = [float((exact / bound).mean()) for exact, bound in both]
    return Claim(
        "(26) is an upper limit of the difference (22)",
        all(bool((exact <= bound).all()) for exact, bound in both),
        f"(22) is {ratio[0]:.0%} of (26) for plastic, {ratio[1]:.0%} for fabric, on average",
    )


def coefficients_are_negatively_correlated(plastic: Objects, fabric: Objects) -> Claim:
    """Section 3: b is low where a is high, and vice versa."""
    found = [objects.correlation[1:5] for objects in (plastic, fabric)]
    every = np.concatenate(found)
    return Claim(
        "(a, b) are negatively correlated over the objects",
        bool((every < 0).all()),
        f"plastic {_span(found[0])}, fabric {_span(found[1])}; below zero at {(every < 0).sum()} of {every.size}",
    )


def fabric_is_worse(plastic: Objects, fabric: Objects) -> Claim:
    """Section 4: the geometric description is more accurate for plastic (Table 3)."""
    E = [float(objects.spread[1:5].mean()) for objects in (plastic, fabric)]
    other = [float(objects.differences[1:, 0, 1:5].mean()) for objects in (plastic, fabric)]
    return Claim(
        "Fabric is worse than plastic",
        E[1] > E[0] and other[1] > other[0],
        f"mean E of (26): plastic {E[0]:.4f}, fabric {E[1]:.4f}; mean CMC(1:1) with the other objects' pairs: "
        f"plastic {other[0]:.2f}, fabric {other[1]:.2f}",
    )


def fabric_is_worse_aimed_anew(plastic: Objects, fabric: Objects) -> Claim:
    """The same with an instrument that is aimed again for every object, as the paper's was."""
    E = [float(objects.spread_aimed_anew()[1:5].mean()) for objects in (plastic, fabric)]
    return Claim(
        "Fabric is worse than plastic (the instrument aimed anew for every object)",
        E[1] > E[0],
        f"mean E of (26): plastic {E[0]:.4f}, fabric {E[1]:.4f}; "
        f"the paper's: {TABLE_3['plastic'].mean():.4f}, {TABLE_3['fabric'].mean():.4f}",
    )


def highlight_and_handle_vary_most(fits: Variation, made: list[Synthesis], camera: str) -> Claim:
    """Section 4: differences by the variation of (A, B) are larger at highlight and handle."""
    parts = made[0].parts
    E = {name: float(fits.spread[part].mean()) for name, part in parts.items() if name != "object"}
    return Claim(
        f"Variation is larger at highlight and handle ({camera})",
        min(E["highlight"], E["handle"]) > E["wall"],
        "mean E_V: " + ", ".join(f"{name} {value:.2f}" for name, value in E.items()),
    )


def residual_is_small(fits: Variation, colors: tuple[str, ...], inside: np.ndarray, camera: str) -> Claim:
    """Section 4: the mean residual of the plastic cup is 0.27 in 0..255."""
    found = fits.residual[:, inside].mean(axis=1)
    return Claim(
        f"The mean residual of a plastic cup is only {RESIDUAL} ({camera})",
        bool((found <= 1.2 * RESIDUAL).all()),
        ", ".join(f"{color} {value:.2f}" for color, value in zip(colors, found, strict=True))
        + " (held if none is a fifth above)",
    )


def plastic_is_close(made: list[Synthesis]) -> Claim:
    """Section 4, Fig. 8: synthesized and target images are perceptually very close."""
    every = np.concatenate([one.within("object") for one in made])
    return Claim(
        "Synthesized plastic is perceptually very close to the target",
        bool(np.median(every) < 1),
        f"CIEDE2000 median {np.median(every):.2f} (held if below 1), 95th percentile {np.quantile(every, 0.95):.2f}",
    )


def deep_folds_are_worst(cloth: Synthesis, others: list[Synthesis]) -> Claim:
    """Section 4, Fig. 10: synthesized colors in deep folds may be less accurate, because of interreflection."""
    medians = {part: float(np.median(cloth.within(part))) for part in ("deep folds", "ridges")}
    rest = max(float(np.median(one.within("object"))) for one in others)
    return Claim(
        "Deep folds are worst",
        medians["deep folds"] > max(medians["ridges"], rest),
        f"median CIEDE2000 in deep folds {medians['deep folds']:.2f}, on ridges {medians['ridges']:.2f}, "
        f"on the worst plastic or fabric object {rest:.2f}",
    )


def cotton_fails_on_satin(found: dict[str, Synthesis]) -> Claim:
    """Section 4: coefficients of cotton cannot be used for satin."""
    medians = {name: float(np.median(one.within("object"))) for name, one in found.items()}
    return Claim(
        "Coefficients of cotton fail on satin",
        medians["cotton to satin"] > 3 * medians["cotton to cotton"],
        "median CIEDE2000 " + ", ".join(f"{name} {value:.2f}" for name, value in medians.items()),
    )


def _span(values: np.ndarray) -> str:
    return f"{values.min():+.2f} to {values.max():+.2f}"


def rivals_fail(made: list[dict], parts: Regions) -> Claim:
    """Section 4, Fig. 11: color transfer is very poor for 3D objects, especially in the highlights."""
    found = {
        (name, part): float(np.median(pooled(made, name, parts[part])))
        for name in (OURS, "Reinhard, mean")
        for part in ("object", "highlight")
    }
    theirs, theirs_there = found["Reinhard, mean", "object"], found["Reinhard, mean", "highlight"]
    ours, ours_there = found[OURS, "object"], found[OURS, "highlight"]
    return Claim(
        "Color transfer in l, alpha, beta is very poor, most in highlights",
        theirs > 3 * ours and theirs_there > theirs and theirs_there > 3 * ours_there,
        f"median CIEDE2000 {theirs:.2f} on the object and {theirs_there:.2f} in its highlight; "
        f"the dichromatic model {ours:.2f} and {ours_there:.2f}",
    )
