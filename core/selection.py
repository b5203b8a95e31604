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
from .picture import Picture, as_weights, strongest
from .reference import window_radius
from .separation import MODEL_ERROR, NO_GLOSS, USUAL_BOUNCE, frame, split
from .stability import Noise

# Pixels that are looked at, for the models and for the noise.
_SAMPLE, _ROWS = 6_000, 12_000

# Light under which a pixel tells nothing, against the reference.
_DARK = 0.08

# Share of pixels up to which a model explains a region; that from which one does not, and a richer one is looked for;
# that from which the light itself is in doubt; and that from which metal shows the colors of its surroundings.
_FEW, _BROKEN, _LIT_OTHERWISE, _MOSTLY = 0.02, 0.035, 0.06, 0.25

# The same for what gloss and bounce together leave of a product in the plane of its color and the white.
_SOME = 0.05

# Residual, as a share of pixels, from which light of another color is looked for: on products that shine, that do not.
_OTHER_LIGHT = (0.2, 0.1)

# Pixels without which nothing can be counted; half the side of the window that steadies a noisy reference.
_FEWEST, _WINDOW = 100, 3

# Side of a block of JPEG; and errors of a compressed picture, in steps, for each share of flat pixels (measured on the
# laboratory's pictures at qualities of 85 to 95).
_BLOCK, _PER_FLAT = 8, 12.0

# Times that a value turns up in a sample, on average, from which values are codes; and gaps on both sides of a level
# that tell its step.
_REPEATED, _AROUND = 4, 3

# Variance in the window of a reference, against that of noise, that noise may be mistaken for; and that up to which
# noise is not seen there. Pixels that a reference is read from.
_MISTAKEN, _SHOWN, _READ = 1.2, 0.2, 6

# Noise of a pixel, relative to its light, from which means of windows are looked at; and half the side of the widest
# window, as a share of the picture.
_STEADY, _WIDEST = 0.006, 0.01

# Light beyond this is no picture of a product.
_HUGE = 1e6

# Ranges of light for the noise.
_BRIGHTNESS = (-np.inf, 0.004, 0.012, 0.03, 0.07, 0.15, 0.3, 0.55, 0.95, 1.6)

# Quantile of the light that is that of a well lit part.
_WELL_LIT = 0.9

# Gloss (as a share of the light) and bounce (in units of the body) that count as seen.
_GLOSS_SEEN, _BOUNCE_SEEN = 0.01, 0.03

# Gloss of the brightest pixels beyond that of the well lit ones, as a share of the light, from which they shine.
_SHINY = 0.05

# Share of clipped pixels from which there may be highlights among them.
_FEWEST_CLIPPED = 0.002

# Tilts of the plane of body and white that a wrong white makes: 0.25 for one that is 30 % wrong in a channel.
_TILTS = np.linspace(-0.4, 0.4, 33)

# Share of the variance that may lie between neighboring pixels where light of another color falls, and in bounce:
# between them it is 0.02 to 0.2 in folds and 0.4 in heather.
_ROUGH, _TEXTURED = 0.1, 0.3

# Sine of the angle to the white under which a product is gray, and up to which it is taken for gray when the region is
# too small to look at.
_GRAY, _LITTLE = 1e-3, 1 / 6

# Mean square of the bounce, against the usual one, beyond which it is something else.
_MOST_BOUNCE = 3.0

# Noise of the split into body and gloss, relative to the light, from which it is smoothed; and up to which a second
# light is worth the noise that it costs, if the gloss of the highlights says that the product shines at all.
_NOISY, _LOUD, _SHINES = 0.02, 0.06, 0.3

# Of two lights: log color ratio of a warmer light to a colder. For narrow bands the logarithm of a black body is
# linear in 1 / T (Finlayson & Hordley 2001, "Color constancy at a pixel"); this is tungsten against daylight.
_WARMER = np.array([0.60, -0.15, -1.31])


_NONE, _QUIET = Noise(0.0, 0.0), Noise(1e-5, 0.0)


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
    body_noise
        Noise of the body color, relative to its length.
    other
        A model that was not taken and may be right, or None.
    """

    mixture: Mixture
    noise: Noise = _NONE
    below: float = NO_GLOSS
    figures: dict[str, float] = field(default_factory=dict)
    body_noise: float = 0.0
    other: Mixture | None = None

    @property
    def broken(self) -> float:
        """Share of pixels that the dichromatic model does not explain."""
        return _broken(self.figures)

    @property
    def matte(self) -> bool:
        """Whether bounce without gloss explains the region."""
        return self.mixture.model == "bounce" and not self.mixture.keeps_white

    @property
    def shines(self) -> bool:
        """Whether highlights have the color of the light; where nothing was looked at, they are taken to."""
        return self.mixture.model != "metal" and self.figures.get("highlights", 1.0) > _FEW

    @property
    def hidden(self) -> bool:
        """Whether windows show colors that the model does not explain, and single pixels are too noisy to say more."""
        noisy = self.figures.get("split_noise", 0.0) > _NOISY
        plain = self.mixture.model in ("dichromatic", "regularized")
        return plain and noisy and self.figures.get("residual", 0.0) > _OTHER_LIGHT[0]


@dataclass(frozen=True, eq=False)
class _Seen:
    """A sample of a region, every pixel relative to its light along the body color."""

    pixels: NDArray[np.float64]
    light: NDArray[np.float64]
    noise: NDArray[np.float64]
    body: NDArray[np.float64]
    white: NDArray[np.float64]
    clipped: float

    @property
    def independent(self) -> float:
        """Pixels that count as independent of each other: by what noise did to the body color, all are wrong."""
        noise = 1 - (MODEL_ERROR / float(np.median(self.noise))) ** 2
        return 1 / (1e-3 + noise / (2 * _WINDOW + 1) ** 2)


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
    steady, body_noise = steadied(picture, body, white, mask, pixel, noise)
    seen = _look(picture, steady, white, mask, noise, body_noise)
    if seen is None:
        little = "dichromatic" if gray > _LITTLE else "body"
        return Evidence(mixture.plain(little, body, white), noise)
    length = float(np.linalg.norm(steady / white))
    figures = _plain(seen)
    relative_noise = float(noise.at(np.array(length))) / length
    figures["split_noise"] = relative_noise / max(gray, _GRAY)
    noisy = figures["split_noise"] > _NOISY
    broken = _broken(figures)
    matte = glossy = False
    # Clipped highlights of the product's own color are those of metal, which gives more of the light back.
    metallic = figures["highlights"] < _FEW and seen.clipped > _FEW
    # K rho is that of the product in the light of its lamps, whatever light the reference lies in.
    usual = feedback = interreflection.USUAL * figures["exposure"] * (2 if metallic else 1)
    if model == "bounce" or (model == "auto" and broken > (_BROKEN / 2 if noisy else _BROKEN)):
        feedback = interreflection.find_feedback(seen.pixels, seen.body, seen.noise, seen.independent, usual)
        figures |= {"feedback": feedback, "matte_unexplained": _matte(seen, feedback)} | _glossy(seen, usual)
        dull = figures["highlights"] < _SHINY and seen.clipped < _FEWEST_CLIPPED
        matte = dull and figures["matte_unexplained"] < max(_FEW, broken / 3)
        few = _SOME if figures["residual"] < _FEW else max(_FEW, broken / 8)
        glossy = figures["glossy_unexplained"] < few and figures["bounce"] < _MOST_BOUNCE
        # What is bounced all over metal is the color of its surroundings.
        glossy &= not metallic or broken < _MOSTLY
        glossy = bool(glossy) and figures["split_noise"] < _LOUD
        glossy = glossy and _roughness(picture, seen, mask, noise, axis=0) < _TEXTURED
    found: Mixture | None
    other: Mixture | None = None
    away = float(np.linalg.norm(frame(steady / white, feedback).bounce[1:]))
    if matte and relative_noise / max(away / length, _GRAY) < _NOISY:
        found = mixture.matte_bounce(body, white, feedback)
    elif matte or glossy or model == "bounce":
        found = mixture.mapped("bounce", steady, white, feedback if matte else usual, gloss=not matte)
        if glossy and figures["residual"] > _OTHER_LIGHT[1]:
            other = _second_light(seen, body, white, figures)
    elif model == "lights" or (
        model == "auto" and broken > _LIT_OTHERWISE and _roughness(picture, seen, mask, noise, axis=1) < _ROUGH
    ):
        found, other = _lit(seen, body, white, figures, model, usual)
    else:
        found = None
    if found is None and (noisy or model == "regularized"):
        found = mixture.mapped("regularized", steady, white)
    elif found is None:
        found = mixture.plain("dichromatic", body, white)
    below = max(NO_GLOSS, -figures["least_gloss"]) if found.model == "regularized" else NO_GLOSS
    return Evidence(found, noise, below, figures, body_noise, other)


def _second_light(seen: _Seen, body: NDArray, white: NDArray, figures: dict[str, float]) -> Mixture | None:
    """Two lights, if they explain the region."""
    light, figures["lights_unexplained"] = _lights(seen)
    return mixture.two_lights(body, white, light) if figures["lights_unexplained"] < _LIT_OTHERWISE else None


def _lit(
    seen: _Seen, body: NDArray, white: NDArray, figures: dict[str, float], model: str, usual: float
) -> tuple[Mixture | None, Mixture | None]:
    """A model for what gloss and bounce do not explain, None if it is not the light either; and one that may be right.

    Two lights, if the product shines and they do explain it, and another white alone does not. Without highlights a
    gain by channel is right for any light, and for metal. But where bounce explains half of it and no pixel is paler
    than the body color, it is a fold.
    """
    if model == "lights":
        return mixture.two_lights(body, white, _lights(seen)[0]), None
    other = _second_light(seen, body, white, figures)
    figures["paler"] = _paler(seen)
    half = figures["glossy_unexplained"] < _broken(figures) / 2
    fold = half and figures["paler"] < _FEW and figures["bounce"] < _MOST_BOUNCE
    if fold and figures["split_noise"] < _NOISY:
        return mixture.mapped("bounce", body, white, usual), None
    figures["off_plane"] = _off_plane(seen)
    if figures["off_plane"] < _LIT_OTHERWISE:
        return None, None
    if figures["highlights"] > _FEW:
        quiet = figures["split_noise"] < (_LOUD if figures["highlights"] > _SHINES else _NOISY)
        return (other, None) if figures["residual"] > _OTHER_LIGHT[0] and quiet else (None, other)
    if figures["split_noise"] > _NOISY:
        return None, other
    if figures["residual"] > _OTHER_LIGHT[1] or figures["bounce"] > _MOST_BOUNCE:
        return mixture.metal(body, white), None
    return None, other


# --- What is looked at --------------------------------------------------------------------------------------
def noise_across(picture: Picture, body: NDArray, white: NDArray) -> Noise:
    """Noise of the color across the body color, against the light along it, both relative to the white.

    Found like :func:`stability.estimate_noise`, but shading and texture of one color do not count here. Texture of
    several colors does: of all ranges of brightness the quietest, against the fit, is believed. It is no less than
    what rounding to codes makes, and compression, which takes the fine noise away and leaves a coarse one.
    """
    height, width = picture.shape
    step = max(1, height * width // _ROWS)
    rows = slice(step // 2, None, step)
    floor = _rounding(picture, body, white, rows)
    if width < 3:
        return floor
    linear = picture.linear(rows)
    fine = (np.abs(linear) < min(picture.clip_level, _HUGE)).all(axis=2) & (linear > 0).any(axis=2)
    axes = frame(body / white)
    basis = (np.vstack([axes.along, axes.across]) / white).astype(np.float32)
    axial = linear @ basis.T
    fine = fine[:, 2:] & fine[:, 1:-1] & fine[:, :-2]
    bright = (axial[:, 2:, 0] + axial[:, :-2, 0])[fine] / 2
    second = np.abs(axial[:, 2:, 1:] - 2 * axial[:, 1:-1, 1:] + axial[:, :-2, 1:])[fine]
    parts, variances, weights = [], [], []
    for low, high in itertools.pairwise(_BRIGHTNESS):
        chosen = (bright > low) & (bright <= high)
        n = int(np.count_nonzero(chosen))
        if n < 200:
            continue
        # Median of the absolute second difference of Gaussian noise: 0.6745 sqrt(6) sigma; the lower quartile 0.3186.
        variance = (float(np.quantile(second[chosen], 0.25)) / 0.3186) ** 2 / 6
        if variance > 0:
            parts.append((1.0, float(bright[chosen].mean())))
            variances.append(variance)
            weights.append(np.sqrt(n) / (variance + 1e-9))
    if not parts:
        return floor
    a, v, k = np.array(parts), np.array(variances), np.array(weights)
    read, shot = np.linalg.lstsq(a * k[:, None], v * k, rcond=None)[0] if len(parts) > 1 else (v[0], 0.0)
    if shot < 0:
        read, shot = float(np.average(v, weights=k)), 0.0
    if read < 0:
        read, shot = 0.0, float((a[:, 1] * v * k * k).sum() / (a[:, 1] ** 2 * k * k).sum())
    quietest = min(1.0, float((v / (a @ [read, shot])).min()))
    return Noise(max(floor.read, float(np.sqrt(read * quietest))), max(floor.shot, float(shot * quietest)))


def _rounding(picture: Picture, body: NDArray, white: NDArray, rows: slice) -> Noise:
    """What the steps of the codes do to the color across, and compression by the flatness that it leaves."""
    codes = picture.pixels[rows, :, :3]
    light, coarseness = np.stack([np.zeros(3), np.clip(body, 0, 1)]), 1.0
    if codes.dtype.kind == "f":
        steps = np.stack([_steps(picture.linear(rows)[..., k], light[:, k]) for k in range(3)], axis=1)
    else:
        half = 0.5 / np.iinfo(codes.dtype).max
        encoded, coarseness = np.asarray(picture.curve.encode(light), np.float64), _coarseness(codes)
        above, below = (np.asarray(picture.curve.decode(encoded + k * half), np.float64) for k in (1, -1))
        steps = above - below
    # Uniform over a step, whose square grows about as the light.
    read, full = ((steps / white) ** 2).mean(axis=1) / 12 * coarseness**2
    shot = max(0.0, float(full - read)) / float(np.linalg.norm(body / white))
    return Noise(max(_QUIET.read, float(np.sqrt(read))), shot)


def _steps(values: NDArray, light: NDArray) -> NDArray[np.float64]:
    """Steps between the values of a channel (h, w) at some levels of light (n,); 0 if they are no codes."""
    varied = values[:, 1:][values[:, 1:] != values[:, :-1]]
    levels = np.unique(varied)
    if len(levels) < 3 or _REPEATED * len(levels) > len(varied):
        return np.zeros(len(light))
    gaps = np.diff(levels)
    at = np.clip(np.searchsorted(levels, light), _AROUND, max(_AROUND, len(gaps) - _AROUND))
    return np.array([np.median(gaps[k - _AROUND : k + _AROUND]) for k in at])


def _coarseness(codes: NDArray) -> float:
    """Times by which the errors of codes exceed their rounding: 1 for a noisy picture, about 3 for a good JPEG.

    Counted are triples of pixels on a straight line, which noise and rounding leave few of, and compression many;
    without what is of one code for a width of a block, such as a cut-out's ground.
    """
    if codes.shape[1] <= _BLOCK:
        return 1.0
    c = codes.astype(np.int32)
    varied = (c[:, _BLOCK:] != c[:, :-_BLOCK]).any(axis=2)
    straight = (c[:, 2:] - 2 * c[:, 1:-1] + c[:, :-2] == 0).all(axis=2)[:, : varied.shape[1]]
    return 1 + _PER_FLAT * float(straight[varied].mean()) if varied.any() else 1.0


def steadied(
    picture: Picture, body: NDArray, white: NDArray, mask: NDArray | None, pixel: tuple[int, int] | None, noise: Noise
) -> tuple[NDArray[np.float64], float]:
    """(3,) the body color with the color across from a wider window around its pixel, where noise blurs it.

    And the noise left in it, relative to its length; 0 without a pixel.

    Only pixels that differ by no more than noise from the common mean count, and the less, the more of texture or
    shine the window holds: what noise does not explain of its variance is a difference from the body color that was
    read.
    """
    if pixel is None:
        return body, 0.0
    x, y = pixel
    reach = max(_WINDOW, window_radius(picture.shape))
    rows, columns = slice(max(0, y - reach), y + reach + 1), slice(max(0, x - reach), x + reach + 1)
    near = picture.linear(rows, columns).reshape(-1, 3)
    keep = near.max(axis=1) < picture.clip_level
    if mask is not None:
        keep &= as_weights(mask[rows, columns]).reshape(-1) > 0.95
    axes = frame(body / white)
    single = float(noise.at(np.array(axes.length))) / axes.length
    balanced = near[keep] / white
    light = balanced @ axes.along
    balanced, light = balanced[light > _DARK * axes.length], light[light > _DARK * axes.length]
    color = (balanced @ axes.across.T) / light[:, None]
    sigma = noise.at(light) / light
    close = np.ones(len(color), bool)
    mean = np.zeros(2)
    for _ in range(4):
        if np.count_nonzero(close) < 9:
            return body, single / _READ**0.5
        mean = np.average(color[close], axis=0, weights=sigma[close] ** -2)
        close = (np.abs(color - mean) < 3 * sigma[:, None]).all(axis=1)
    beyond = max(0.0, float(np.median((color - mean) ** 2 / sigma[:, None] ** 2)) / 0.4549 - _MISTAKEN)
    share = 1 / (1 + _READ * beyond)
    steady = axes.along + share * mean @ axes.across
    # Noise that does not show in a window, as that of coarse codes, is common to all of it.
    common = max(0.0, 1 - float(np.mean((color - mean)[close] ** 2 / sigma[close, None] ** 2)) / _SHOWN)
    left = single * float(np.hypot((1 - share) / _READ**0.5, share / np.count_nonzero(close) ** 0.5))
    left = float(np.hypot(left, single * common**0.5))
    return steady * axes.length / np.linalg.norm(steady) * white, left


def _look(
    picture: Picture, body: NDArray, white: NDArray, mask: NDArray | None, noise: Noise, body_noise: float
) -> _Seen | None:
    """A sample of the region without what is clipped or dark; None if little is left.

    Where the photo is noisy, means of small windows stand for the pixels: a sum of terms stays one.
    """
    v = body / white
    length = float(np.linalg.norm(v))
    relative = float(noise.at(np.array(length))) / length
    widest = max(_WINDOW - 1, round(_WIDEST * max(picture.shape)))
    reach = int(np.rint(np.clip(np.nan_to_num(relative / _STEADY - 1) / 2, 0, widest)))
    if reach > 0:
        pixels, counts = _windows(picture, mask, reach)
    else:
        pixels = picture.sample(_SAMPLE, mask).astype(np.float64)
        counts = np.ones(len(pixels))
    ordinary = (np.abs(pixels) < _HUGE).all(axis=1)
    pixels, counts = pixels[ordinary], counts[ordinary]
    if len(pixels) < _FEWEST:
        return None
    clipped = pixels.max(axis=1) >= picture.clip_level
    balanced, counts = pixels[~clipped] / white, counts[~clipped]
    light = balanced @ (v / length)
    lit = light > _DARK * length
    if np.count_nonzero(lit) < _FEWEST:
        return None
    light = light[lit]
    own = noise.at(light) / light / np.sqrt(counts[lit])
    return _Seen(
        balanced[lit] / light[:, None],
        light,
        np.sqrt(own**2 + body_noise**2 + MODEL_ERROR**2),
        v,
        white,
        float(clipped.mean()),
    )


def _windows(picture: Picture, mask: NDArray | None, reach: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n, 3) means over windows all over the region, of what is the product's alone, and how many pixels each has.

    A window around a clipped pixel is that pixel.
    """
    height, width = picture.shape
    whole = np.ones((height, width), bool) if mask is None else strongest(mask)
    step = max(1, int(np.sqrt(np.count_nonzero(whole) / _SAMPLE)))
    rows, columns = np.nonzero(whole[step // 2 :: step, step // 2 :: step])
    rows, columns = (at * step + step // 2 for at in (rows, columns))
    center = picture.at(rows, columns)
    sums, counts = np.zeros((len(rows), 3)), np.zeros(len(rows))
    for down, right in itertools.product(range(-reach, reach + 1), repeat=2):
        at = np.clip(rows + down, 0, height - 1), np.clip(columns + right, 0, width - 1)
        near = picture.at(*at)
        counted = whole[at] & (near.max(axis=1) < picture.clip_level)
        sums += near * counted[:, None]
        counts += counted
    kept = (center.max(axis=1) < picture.clip_level) & (counts > 0)
    return np.where(kept[:, None], sums / np.maximum(counts, 1)[:, None], center), np.where(kept, counts, 1.0)


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
        "exposure": _exposure(seen, gloss),
    }


def _broken(figures: dict[str, float]) -> float:
    return max(figures.get("residual", 0.0), figures.get("negative_gloss", 0.0))


def _exposure(seen: _Seen, gloss: NDArray) -> float:
    """Light of the well lit matte parts, in that of the reference."""
    matte = seen.light[gloss < _SHINY]
    return float(np.quantile(matte, _WELL_LIT) / np.linalg.norm(seen.body)) if len(matte) else 1.0


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
    unit = axes.length / size / axes.exposure
    bounce, spread = (y @ along) * unit, seen.noise * unit
    wrong = np.abs(y @ off) > 3 * seen.noise
    return float((wrong | (bounce < -_BOUNCE_SEEN - 3 * spread)).mean())


def _glossy(seen: _Seen, feedback: float) -> dict[str, float]:
    """Share that body, bounce and gloss together do not explain; and the bounce they need, against the usual."""
    axes = frame(seen.body, feedback)
    light = np.ones(len(seen.pixels))
    gloss, bounce, left = split(light, (seen.pixels @ axes.across.T).T, seen.noise**2, axes, bounce=True)
    wrong = (gloss < -_GLOSS_SEEN - 3 * seen.noise / axes.white[1]) | (left > 9)
    return {
        "glossy_unexplained": float(wrong.mean()),
        "bounce": float(np.mean((bounce * axes.length / axes.exposure / USUAL_BOUNCE) ** 2)),
    }


def _paler(seen: _Seen) -> float:
    """Share that leaves the body color the other way than light that met it twice: gloss, mirrored things, a lamp."""
    axes = frame(seen.body)
    towards = np.array(axes.bounce[1:]) / max(float(np.linalg.norm(axes.bounce[1:])), 1e-9)
    return float((seen.pixels @ axes.across.T @ towards < -2 * _GLOSS_SEEN - 3 * seen.noise).mean())


def _lights(seen: _Seen) -> tuple[NDArray[np.float64], float]:
    """Color of the second light that leaves the least gloss, and the share of pixels that stay impossible."""
    length = float(np.linalg.norm(seen.body))
    best, least, share = np.ones(3), np.inf, 1.0
    pixels = seen.pixels.T * length
    for warmth in np.linspace(-1.2, 1.2, 24):
        light = np.exp(warmth * _WARMER)
        second = seen.body * light
        second *= length**2 / (second @ seen.body)
        a, b, c = np.linalg.inv(np.column_stack([seen.body, np.ones(3), second])) @ pixels
        below = [np.clip(-k, 0, most) for k, most in ((a, 0.2), (b, 0.1), (c, 0.2))]
        cost = float(np.mean(np.minimum(np.abs(b), 0.1) + 0.5 * below[0] + 2 * below[1] + 0.5 * below[2]))
        if cost < least:
            best, least, share = light, cost, float(((b < -0.02) | (a < -0.05)).mean())
    return best, share


def _off_plane(seen: _Seen) -> float:
    """Share of pixels that the plane of the body color and the best of other whites does not explain."""
    y1, y2 = (seen.pixels @ frame(seen.body).across.T).T
    return min(float((np.abs(y2 - t * y1) > 3 * np.hypot(1, t) * seen.noise).mean()) for t in _TILTS)


def _roughness(picture: Picture, seen: _Seen, mask: NDArray | None, noise: Noise, axis: int) -> float:
    """Share of the variance of a color across that lies between neighbors: small for light, not for texture.

    Axis 0 lies in the plane of body and white, axis 1 leaves it.
    """
    height, width = picture.shape
    rows = slice(None, None, max(1, height * width // _ROWS))
    axes = frame(seen.body)
    balanced = picture.linear(rows) / seen.white
    light = np.maximum(balanced @ axes.along, _DARK * axes.length)
    off = (balanced @ axes.across[axis]) / light
    inside = np.ones(off.shape, bool) if mask is None else as_weights(mask[rows]) > 0.95
    both = inside[:, 1:] & inside[:, :-1]
    if np.count_nonzero(both) < _FEWEST:
        return np.inf
    grain = (noise.at(light) / light)[inside].mean() ** 2
    step = (np.median(np.abs(off[:, 1:] - off[:, :-1])[both]) / 0.6745) ** 2 / 2
    whole = float(off[inside].var())
    return max(0.0, step - grain) / max(whole - grain, 1e-12)
