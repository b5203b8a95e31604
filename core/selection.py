"""Which model a region needs, from what its pixels show: the simplest that leaves nothing beyond the noise.

The evidence is counted on a sample of the region, in shares of its pixels that a model cannot explain: more color
across the body color than noise and gloss make (residual), or gloss below zero, which no light makes.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from . import interreflection, mixture
from .dichromatic import sine
from .mixture import Mixture
from .picture import Picture, as_weights
from .reference import window_radius
from .separation import MODEL_ERROR, NO_GLOSS, USUAL_BOUNCE, frame, split
from .stability import Noise

# Pixels that are looked at, for the models and for the noise.
_SAMPLE, _ROWS = 6_000, 12_000

# Light under which a pixel tells nothing, against the reference.
_DARK = 0.08

# Share of pixels up to which a model explains a region; that from which one does not, and a richer one is looked for;
# and that from which the light itself is in doubt.
_FEW, _BROKEN, _LIT_OTHERWISE = 0.02, 0.035, 0.06

# Residual, as a share of pixels, from which light of another color is looked for: on products that shine, that do not.
_OTHER_LIGHT = (0.2, 0.1)

# Pixels without which nothing can be counted; half the side of the window that steadies a noisy reference.
_FEWEST, _WINDOW = 100, 3

# Light beyond this is no picture of a product.
_HUGE = 1e6

# Ranges of light for the noise.
_BRIGHTNESS = (-np.inf, 0.004, 0.012, 0.03, 0.07, 0.15, 0.3, 0.55, 0.95, 1.6)

# Gloss (as a share of the light) and bounce (in units of the body) that count as seen.
_GLOSS_SEEN, _BOUNCE_SEEN = 0.01, 0.03

# Gloss of the brightest pixels beyond that of the well lit ones, as a share of the light, from which they shine.
_SHINY = 0.05

# Share of clipped pixels from which there may be highlights among them.
_FEWEST_CLIPPED = 0.002

# Share of the variance that may lie between neighboring pixels where light of another color falls.
_ROUGH = 0.1

# Sine of the angle to the white under which a product is gray, and up to which it is taken for gray when the region is
# too small to look at.
_GRAY, _LITTLE = 1e-3, 1 / 6

# Mean square of the bounce, against the usual one, beyond which it is something else.
_MOST_BOUNCE = 1.2

# Noise of the split into body and gloss, relative to the light, from which it is smoothed.
_NOISY = 0.02

# Of two lights: log color ratio of a warmer light to a colder. For narrow bands the logarithm of a black body is
# linear in 1 / T (Finlayson & Hordley 2001, "Color constancy at a pixel"); this is tungsten against daylight.
_WARMER = np.array([0.60, -0.15, -1.31])


_NONE = Noise(0.0, 0.0)


@dataclass(frozen=True)
class Evidence:
    """What was seen, and the model it speaks for.

    Attributes
    ----------
    mixture
        The model.
    noise
        Of the color across the body color, relative to the white.
    below
        How far gloss may go below zero in maps, as a share of the light.
    figures
        Shares and levels, plain numbers for the report.
    """

    mixture: Mixture
    noise: Noise = _NONE
    below: float = NO_GLOSS
    figures: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class _Seen:
    """A sample of a region, every pixel relative to its light along the body color."""

    pixels: NDArray[np.float64]
    light: NDArray[np.float64]
    noise: NDArray[np.float64]
    body: NDArray[np.float64]
    white: NDArray[np.float64]
    clipped: float


def choose(
    picture: Picture,
    body: NDArray,
    white: NDArray,
    mask: NDArray | None,
    pixel: tuple[int, int] | None = None,
    model: str = "auto",
) -> Evidence:
    """Look at a region and choose its model, or fit the one that is asked for.

    Parameters
    ----------
    picture, mask
        The photo, and checked coverage or None.
    body, white
        (3,) V and W.
    pixel
        (x, y) of the reference, or None.
    model
        "auto", or one of `mixture.MODELS`.

    Raises
    ------
    ReferenceColorError
        If the model needs a body color that differs from the white's, and this does not.
    """
    if model in ("body", "dichromatic"):
        return Evidence(mixture.plain(model, body, white))
    if model == "metal":
        return Evidence(mixture.metal(body, white))
    gray = sine(body, white)
    if model == "auto" and gray < _GRAY:
        return Evidence(mixture.plain("body", body, white))
    noise = noise_across(picture, body, white)
    steady = steadied(picture, body, white, mask, pixel, noise)
    seen = _look(picture, steady, white, mask, noise)
    if seen is None:
        little = "dichromatic" if gray > _LITTLE else "body"
        return Evidence(mixture.plain(little, body, white), noise)
    length = float(np.linalg.norm(steady / white))
    figures = _plain(seen)
    figures["split_noise"] = float(noise.at(np.array(length)) / length / max(gray, _GRAY))
    noisy = figures["split_noise"] > _NOISY
    broken = max(figures["negative_gloss"], figures["residual"])
    matte = glossy = False
    feedback = interreflection.USUAL
    if model == "bounce" or (model == "auto" and broken > (_BROKEN / 2 if noisy else _BROKEN)):
        feedback = interreflection.find_feedback(seen.pixels, seen.body, seen.noise)
        figures |= {"feedback": feedback, "matte_unexplained": _matte(seen, feedback)} | _glossy(seen)
        dull = figures["highlights"] < _SHINY and seen.clipped < _FEWEST_CLIPPED
        matte = dull and figures["matte_unexplained"] < max(_FEW, broken / 3)
        glossy = figures["glossy_unexplained"] < max(_FEW, broken / 8) and figures["bounce"] < _MOST_BOUNCE
    found: Mixture | None
    if matte and not noisy:
        found = mixture.matte_bounce(body, white, feedback)
    elif matte or glossy or model == "bounce":
        found = mixture.mapped("bounce", steady, white, feedback if matte else interreflection.USUAL, gloss=not matte)
    elif model == "lights" or (model == "auto" and broken > _LIT_OTHERWISE and _is_smooth(picture, seen, mask, noise)):
        found = _lit(seen, body, white, figures, model)
    else:
        found = None
    if found is None and (noisy or model == "regularized"):
        found = mixture.mapped("regularized", steady, white)
    elif found is None:
        found = mixture.plain("dichromatic", body, white)
    below = max(NO_GLOSS, -figures["least_gloss"]) if found.model == "regularized" else NO_GLOSS
    return Evidence(found, noise, below, figures)


def _lit(seen: _Seen, body: NDArray, white: NDArray, figures: dict[str, float], model: str) -> Mixture | None:
    """A model for what gloss and bounce do not explain; None if it is not the light either.

    Two lights, if the product shines and they do explain it. Without highlights a gain by channel is right for any
    light, and for metal; but a fold whose bounce is only half explained is a fold.
    """
    light, figures["lights_unexplained"] = _lights(seen)
    if model == "lights":
        return mixture.two_lights(body, white, light)
    if figures["highlights"] > _FEW:
        explained = figures["residual"] > _OTHER_LIGHT[0] and figures["lights_unexplained"] < _LIT_OTHERWISE
        return mixture.two_lights(body, white, light) if explained else None
    if figures["residual"] > _OTHER_LIGHT[1] or figures["bounce"] > _MOST_BOUNCE:
        return mixture.metal(body, white)
    return mixture.mapped("bounce", body, white, interreflection.USUAL)


# --- What is looked at --------------------------------------------------------------------------------------
def noise_across(picture: Picture, body: NDArray, white: NDArray) -> Noise:
    """Noise of the color across the body color, against the light along it, both relative to the white.

    Found like :func:`stability.estimate_noise`, but shading and texture of one color do not count here. Texture of
    several colors does: of all ranges of brightness the quietest, against the fit, is believed.
    """
    height, width = picture.shape
    quiet = Noise(1e-5, 0.0)
    if width < 3:
        return quiet
    step = max(1, height * width // _ROWS)
    linear = picture.linear(slice(step // 2, None, step))
    fine = (np.abs(linear) < min(picture.clip_level, _HUGE)).all(axis=2) & (linear > 0).any(axis=2)
    axes = frame(body / white)
    basis = (np.vstack([axes.along, axes.across]) / white).astype(np.float32)
    axial = linear @ basis.T
    fine = fine[:, 2:] & fine[:, 1:-1] & fine[:, :-2]
    bright = (axial[:, 2:, 0] + axial[:, :-2, 0])[fine] / 2
    second = np.abs(axial[:, 2:, 1:] - 2 * axial[:, 1:-1, 1:] + axial[:, :-2, 1:])[fine]
    rows, variances, weights = [], [], []
    for low, high in itertools.pairwise(_BRIGHTNESS):
        chosen = (bright > low) & (bright <= high)
        n = int(np.count_nonzero(chosen))
        if n < 200:
            continue
        # Median of the absolute second difference of Gaussian noise: 0.6745 sqrt(6) sigma; the lower quartile 0.3186.
        variance = (float(np.quantile(second[chosen], 0.25)) / 0.3186) ** 2 / 6
        if variance > 0:
            rows.append((1.0, float(bright[chosen].mean())))
            variances.append(variance)
            weights.append(np.sqrt(n) / (variance + 1e-9))
    if not rows:
        return quiet
    a, v, k = np.array(rows), np.array(variances), np.array(weights)
    read, shot = np.linalg.lstsq(a * k[:, None], v * k, rcond=None)[0] if len(rows) > 1 else (v[0], 0.0)
    if shot < 0:
        read, shot = float(np.average(v, weights=k)), 0.0
    if read < 0:
        read, shot = 0.0, float((a[:, 1] * v * k * k).sum() / (a[:, 1] ** 2 * k * k).sum())
    quietest = min(1.0, float((v / (a @ [read, shot])).min()))
    return Noise(max(quiet.read, float(np.sqrt(read * quietest))), float(shot * quietest))


def steadied(
    picture: Picture, body: NDArray, white: NDArray, mask: NDArray | None, pixel: tuple[int, int] | None, noise: Noise
) -> NDArray[np.float64]:
    """(3,) the body color with the color across from a wider window around its pixel, where noise blurs it.

    Only pixels that differ by no more than noise from the common mean count.
    """
    if pixel is None:
        return body
    x, y = pixel
    reach = max(_WINDOW, window_radius(picture.shape))
    rows, columns = slice(max(0, y - reach), y + reach + 1), slice(max(0, x - reach), x + reach + 1)
    near = picture.linear(rows, columns).reshape(-1, 3)
    keep = near.max(axis=1) < picture.clip_level
    if mask is not None:
        keep &= as_weights(mask[rows, columns]).reshape(-1) > 0.95
    axes = frame(body / white)
    balanced = near[keep] / white
    light = balanced @ axes.along
    balanced, light = balanced[light > _DARK * axes.length], light[light > _DARK * axes.length]
    color = (balanced @ axes.across.T) / light[:, None]
    sigma = noise.at(light) / light
    close = np.ones(len(color), bool)
    mean = np.zeros(2)
    for _ in range(4):
        if np.count_nonzero(close) < 9:
            return body
        mean = np.average(color[close], axis=0, weights=sigma[close] ** -2)
        close = (np.abs(color - mean) < 3 * sigma[:, None]).all(axis=1)
    steady = axes.along + mean @ axes.across
    return steady * axes.length / np.linalg.norm(steady) * white


def _look(picture: Picture, body: NDArray, white: NDArray, mask: NDArray | None, noise: Noise) -> _Seen | None:
    """A sample of the region without what is clipped or dark; None if little is left."""
    pixels = picture.sample(_SAMPLE, mask)
    pixels = pixels[(np.abs(pixels) < _HUGE).all(axis=1)]
    if len(pixels) < _FEWEST:
        return None
    clipped = pixels.max(axis=1) >= picture.clip_level
    balanced = pixels[~clipped] / white
    v = body / white
    light = balanced @ (v / np.linalg.norm(v))
    lit = light > _DARK * np.linalg.norm(v)
    if np.count_nonzero(lit) < _FEWEST:
        return None
    light = light[lit]
    return _Seen(
        balanced[lit] / light[:, None],
        light,
        np.hypot(noise.at(light) / light, MODEL_ERROR),
        v,
        white,
        float(clipped.mean()),
    )


# --- What single models leave unexplained ---------------------------------------------------------------------
def _plain(seen: _Seen) -> dict[str, float]:
    """Shares that the dichromatic model does not explain, and gloss in the highlights."""
    axes = frame(seen.body)
    y1, y2 = (seen.pixels @ axes.across.T).T
    gloss, spread = y1 / axes.white[1], seen.noise / axes.white[1]
    low, high = np.quantile(seen.light, (0.8, 0.98))
    bright, lit = gloss[seen.light > high], gloss[(seen.light > low) & (seen.light <= high)]
    doubt = 3 * float(np.median(spread)) / np.sqrt(max(len(bright), 1))
    return {
        "residual": float((np.abs(y2) > 3 * seen.noise).mean()),
        "negative_gloss": float((gloss < -_GLOSS_SEEN - 3 * spread).mean()),
        "highlights": float(bright.mean() - lit.mean() - doubt) if len(bright) and len(lit) else 0.0,
        "least_gloss": float(np.quantile(gloss + 3 * spread, 0.02)),
    }


def _matte(seen: _Seen, feedback: float) -> float:
    """Share that body and bounce without gloss do not explain."""
    axes = frame(seen.body, feedback)
    size = float(np.linalg.norm(axes.bounce[1:]))
    if size < 1e-9:
        return 1.0
    along = np.array(axes.bounce[1:]) / size
    off = np.array([-along[1], along[0]])
    y = seen.pixels @ axes.across.T
    # Bounce in units of the body's light, as in `split`.
    bounce, spread = (y @ along) * axes.length / size, seen.noise * axes.length / size
    wrong = np.abs(y @ off) > 3 * seen.noise
    return float((wrong | (bounce < -_BOUNCE_SEEN - 3 * spread)).mean())


def _glossy(seen: _Seen) -> dict[str, float]:
    """Share that body, bounce and gloss together do not explain; and the bounce they need, against the usual."""
    axes = frame(seen.body, interreflection.USUAL)
    light = np.ones(len(seen.pixels))
    gloss, bounce, left = split(light, (seen.pixels @ axes.across.T).T, seen.noise**2, axes, bounce=True)
    wrong = (gloss < -_GLOSS_SEEN - 3 * seen.noise / axes.white[1]) | (left > 9)
    return {
        "glossy_unexplained": float(wrong.mean()),
        "bounce": float(np.mean((bounce * axes.length / USUAL_BOUNCE) ** 2)),
    }


def _lights(seen: _Seen) -> tuple[NDArray[np.float64], float]:
    """Color of the second light that leaves the least gloss, and the share of pixels that stay impossible."""
    length = float(np.linalg.norm(seen.body))
    best, least, share = np.ones(3), np.inf, 1.0
    for warmth in np.linspace(-1.2, 1.2, 24):
        light = np.exp(warmth * _WARMER)
        second = seen.body * light
        second *= length**2 / (second @ seen.body)
        a, b, c = np.linalg.solve(np.column_stack([seen.body, np.ones(3), second]), seen.pixels.T * length)
        below = [np.clip(-k, 0, most) for k, most in ((a, 0.2), (b, 0.1), (c, 0.2))]
        cost = float(np.mean(np.minimum(np.abs(b), 0.1) + 0.5 * below[0] + 2 * below[1] + 0.5 * below[2]))
        if cost < least:
            best, least, share = light, cost, float(((b < -0.02) | (a < -0.05)).mean())
    return best, share


def _is_smooth(picture: Picture, seen: _Seen, mask: NDArray | None, noise: Noise) -> bool:
    """Whether what leaves the plane of body and white changes slowly over the region, as light does and texture not."""
    height, width = picture.shape
    rows = slice(None, None, max(1, height * width // _ROWS))
    axes = frame(seen.body)
    balanced = picture.linear(rows) / seen.white
    light = np.maximum(balanced @ axes.along, _DARK * axes.length)
    off = (balanced @ axes.across[1]) / light
    inside = np.ones(off.shape, bool) if mask is None else as_weights(mask[rows]) > 0.95
    both = inside[:, 1:] & inside[:, :-1]
    if np.count_nonzero(both) < _FEWEST:
        return False
    grain = (noise.at(light) / light)[inside].mean() ** 2
    step = (np.median(np.abs(off[:, 1:] - off[:, :-1])[both]) / 0.6745) ** 2 / 2
    whole = float(off[inside].var())
    return step - grain < _ROUGH * (whole - grain)
