"""What will become of a target color: how it is converted, whether it can be held, and how it looks in other light."""

from __future__ import annotations

from typing import Any

from ..core import gamut, metamerism
from ..core.colorspace import SPACES, SRGB
from ..core.recipe import Prepared
from ..core.spectra import Spectrum
from ..core.swatches import Encoded, Swatch


def about(prepared: Prepared, index: int) -> dict[str, Any]:
    """Plain values on the target of a region; {} where it has none.

    Its gamut is that of integer files in the photo's own space. Looks and metamerism are those of its spectrum, the
    latter against the spectrum of the product's present color, if there are both.
    """
    recipe, region = prepared.recipe, prepared.recipe.regions[index]
    swatch = region.target
    if swatch is None:
        return {}
    light = recipe.illuminant if isinstance(recipe.illuminant, str) else None
    found: dict[str, Any] = {
        "target_kind": swatch.kind,
        "target_fate": swatch.fate(prepared.space, light, recipe.observer, recipe.camera, recipe.adaptation),
    }
    asked = prepared.target(index)
    if gamut.out_of_gamut(asked):
        nearest = gamut.nearest(asked, prepared.space)
        found["nearest"] = {
            "color": _written(nearest.linear.tolist(), prepared),
            "linear": nearest.linear.tolist(),
            "ciede2000": float(nearest.difference),
        }
    if unknown := metamerism.cannot_be_known(swatch):
        return found | {"unknown": unknown}
    looks = metamerism.under_lights(swatch, observer=recipe.observer)
    found["looks"] = [{"light": k.light, "lab": k.lab.tolist(), "shift_ciede2000": k.shift} for k in looks]
    if region.source is not None and isinstance(region.source.color, Spectrum):
        indices = metamerism.special_indices(region.source, swatch, observer=recipe.observer)
        found["metamerism"] = [{"test": i.test, "index": i.value, "sentence": i.sentence} for i in indices]
    return found


def _written(linear: list[float], prepared: Prepared) -> str:
    """The color as a target can be written, in codes where the photo's space has a name."""
    name = next((name for name, space in SPACES.items() if space is prepared.space), None)
    if name is None:
        return Swatch.from_linear(linear).written
    codes = prepared.space.curve.encode(linear)
    if prepared.space is SRGB:
        return Swatch.from_srgb(codes).text
    red, green, blue = codes.round(4).tolist()
    return Swatch("", Encoded((red, green, blue), name)).written


def in_words(region: dict[str, Any]) -> list[str]:
    """Lines for people about what `about` found."""
    lines = [f"Swatch     {region['target_fate']}"] if "target_fate" in region else []
    if "nearest" in region:
        lines.append(
            f"Gamut      the target is outside: the nearest color of its hue is {region['nearest']['color']}, "
            f"{region['nearest']['ciede2000']:.1f} CIEDE2000 away"
        )
    if "unknown" in region:
        lines.append(f"Under      {region['unknown']}")
    if "looks" in region:
        shifts = ", ".join(f"{look['light']} {look['shift_ciede2000']:.1f}" for look in region["looks"][1:])
        lines.append(
            f"Under      {shifts} CIEDE2000 from its look under {region['looks'][0]['light']}, to an adapted eye"
        )
    if "metamerism" in region:
        values = ", ".join(f"{index['test']} {index['index']:.1f}" for index in region["metamerism"])
        lines.append(
            f"Metamerism {values} against the source; {region['metamerism'][0]['sentence'].partition('; ')[2]}"
        )
    return lines
