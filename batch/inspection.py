"""What a recolor found and would do: figures, words and maps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import colorimetry, gamut
from ..core.errors import FileError
from ..core.recipe import Prepared
from ..core.recolor import Shares
from ..core.stability import matrix_gain
from . import files, target_report

# Mean residual of a plastic cup in the paper, on the scale of 0..255.
PAPER_RESIDUAL = 0.27

# Pixels of a region from which its share out of gamut is estimated.
_SAMPLE = 500_000


def report(photo: files.Photo, prepared: Prepared) -> dict[str, Any]:
    """Everything worth knowing before the pixels are touched, as plain values for JSON."""
    regions = []
    for k, analysis in enumerate(prepared.analyses):
        region = prepared.recipe.regions[k]
        target = prepared.target(k)
        matrix = analysis.matrix(target, prepared.target_white, region.residual)
        change = float(
            colorimetry.delta_e_2000(
                colorimetry.linear_to_lab(analysis.reference, prepared.space),
                colorimetry.linear_to_lab(target, prepared.space),
            )
        )
        noise = matrix_gain(matrix)
        regions.append(
            analysis.report
            | {
                "target": str(region.target) if region.target else None,
                "target_linear": [float(v) for v in target],
                "meaning": region.meaning,
                "change_ciede2000": change,
                "recolor_noise_gain": noise,
                "matrix": matrix.tolist(),
            }
            | target_report.about(prepared, k)
        )
    height, width = photo.pixels.shape[:2]
    return {
        "photo": str(photo.path),
        "width": width,
        "height": height,
        "pixels": str(photo.pixels.dtype),
        "color_space": photo.space.name,
        "assumptions": list(photo.assumptions),
        "white": [float(v) for v in prepared.white],
        "white_source": prepared.white_source,
        "target_white": [float(v) for v in prepared.target_white],
        "regions": regions,
        "warnings": prepared.warnings,
    }


def figures(photo: files.Photo, prepared: Prepared) -> dict[str, Any]:
    """The report with what an output could not hold, estimated from a sample of the product."""
    pixels, outside = 0, 0.0
    for k, analysis in enumerate(prepared.analyses):
        sample = analysis.picture.sample(_SAMPLE, analysis.mask, analysis.extra)
        matrix = analysis.matrix(prepared.target(k), prepared.target_white, prepared.recipe.regions[k].residual)
        pixels += len(sample)
        outside += float(gamut.out_of_gamut(sample @ matrix.T).sum())
    return with_shares(report(photo, prepared), Shares(pixels, outside / pixels if pixels else 0.0))


def with_shares(figures: dict[str, Any], shares: Shares) -> dict[str, Any]:
    """The same report with what the output could not hold."""
    return figures | {
        "out_of_gamut_share": shares.out_of_gamut,
        "warnings": figures["warnings"] + gamut_warning(shares),
    }


def gamut_warning(shares: Shares) -> list[str]:
    """Sentence on what an integer output cannot hold, if that is worth one."""
    if shares.out_of_gamut < 0.001:
        return []
    return [
        f"{shares.out_of_gamut:.1%} of the product falls outside the color space: an integer output keeps its hue and "
        "gives up chroma; write EXR, a wider --output-space, or take a less saturated or darker target."
    ]


def in_words(figures: dict[str, Any], *, brief: bool = False) -> str:
    """The report for people; `brief` after a picture was written."""
    lines = []
    if not brief:
        lines.append(
            f"{figures['photo']}: {figures['width']} x {figures['height']}, {figures['pixels']}, "
            f"{figures['color_space']}"
        )
        lines.append(f"White      {_rgb(figures['white'])}, {figures['white_source']}")
        if figures["target_white"] != figures["white"]:
            lines.append(f"New light  {_rgb(figures['target_white'])}")
    for k, region in enumerate(figures["regions"]):
        if len(figures["regions"]) > 1:
            lines.append(f"Region {k + 1}")
        at = f" at {tuple(region['reference_pixel'])}" if region["reference_pixel"] else ""
        lines.append(f"Reference  {_rgb(region['reference'])}{at}, {region['covered_share']:.1%} of the picture")
        lines.append(
            f"Target     {_rgb(region['target_linear'])}, {region['target'] or 'unchanged color'}: "
            f"{region['change_ciede2000']:.1f} CIEDE2000 away"
        )
        if not brief:
            lines += target_report.in_words(region)
            gain = region["noise_gain"]
            lines.append(
                f"Model      {region['model']}, noise gain {'infinite' if gain is None else f'{gain:.1f}'} to split, "
                f"{region['recolor_noise_gain']:.1f} to recolor"
            )
            if region["evidence"]:
                said = (f"{name.replace('_', ' ')} {value:.3g}" for name, value in region["evidence"].items())
                lines.append(f"Evidence   {', '.join(said)}")
            lines.append(
                f"Residual   mean {region['residual_mean']:.2f}, 95th percentile {region['residual_p95']:.2f} of 255 "
                f"(the paper's plastic cup: {PAPER_RESIDUAL})"
            )
            lines.append(f"Clipped    {region['clipped_share']:.2%}")
    if not brief:
        lines.append(f"Out of gamut {figures['out_of_gamut_share']:.2%}")
    lines += [f"Note: {text}" for text in figures["assumptions"]]
    lines += [f"Warning: {text}" for text in figures["warnings"]]
    lines += [f"Verified   {check['sentence']}" for check in figures.get("verification", [])]
    lines += [f"Wrote {path}" for path in ([figures["output"]] if "output" in figures else figures.get("maps", []))]
    return "\n".join(lines)


def _rgb(values: list[float]) -> str:
    return "(" + ", ".join(f"{v:.3f}" for v in values) + ")"


def write_maps(prepared: Prepared, folder: Path, *, force: bool = False, prefix: str = "") -> list[Path]:
    """Write A, B, residual and predicted error of every region as pictures to look at.

    A is grey with 1 at half brightness, B likewise from black to 0.5 of the white, the residual is multiplied by 8 on
    the scale of the picture, and the predicted error goes from 0 to 10 CIEDE2000. Where the new picture leaves the
    gamut a map of it is white there.

    Returns
    -------
    The files.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"The folder '{folder}' cannot be made ({error.strerror}): choose another one.") from None
    written = []
    for k, analysis in enumerate(prepared.analyses):
        number = f"{k + 1}-" if len(prepared.analyses) > 1 else ""
        maps: dict[str, NDArray] = {
            "A": analysis.A / 2,
            "B": analysis.B * 2,
            "residual": analysis.residual * 8,
            "error": analysis.predicted_error(prepared.target(k), prepared.target_white) / 10,
        }
        if analysis.mask is not None:
            maps["mask"] = analysis.mask / np.float32(
                np.iinfo(analysis.mask.dtype).max if analysis.mask.dtype.kind == "u" else 1
            )
        colors = analysis.recolor(
            prepared.target(k), prepared.target_white, residual=prepared.recipe.regions[k].residual
        )
        outside = gamut.out_of_gamut(colors)
        if outside.any():
            maps["gamut"] = outside.astype(np.float32)
        for name, values in maps.items():
            written.append(files.write_map(folder / f"{prefix}{number}{name}.png", np.clip(values, 0, 1), force=force))
    return written
