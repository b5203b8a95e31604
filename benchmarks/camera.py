"""A camera between the scene and the file: exposure, noise, clipping, tone curve, quantization, JPEG.

Noise is that of a linear sensor: the photons of a pixel are counted (shot noise), and reading adds its own (read
noise); EMVA 1288, release 4.0, section 2. White balance is left out: the channels share one gain.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from dyehouse.core import transfer

Curve = Literal["linear", "srgb", "tone"]

_TONE_SLOPE = 1.35


def tone(codes: NDArray[np.floating]) -> NDArray[np.float64]:
    """Apply a camera's picture style: an S of the sRGB codes (0..1) with more contrast in the middle.

    It is a sigmoid of slope 1.35 at code 0.5 that keeps 0 and 1: the kind of curve that breaks linearity without
    showing.
    """
    x = np.clip(codes, 0.0, 1.0)
    return x**_TONE_SLOPE / (x**_TONE_SLOPE + (1 - x) ** _TONE_SLOPE)


@dataclass(frozen=True)
class Camera:
    """A digital camera.

    Attributes
    ----------
    exposure
        Factor on the light before it meets the sensor; 1.0 of the product of both saturates it.
    electrons
        Electrons that a saturated pixel holds; less means more shot noise. `inf` counts without noise.
    read_noise
        Standard deviation in electrons.
    bits
        Of the file: 8, 12 or 16; 12 are stored in uint16 scaled to the full range, as raw developers do.
    curve
        "linear" (raw), "srgb" or "tone" (sRGB with a picture style that nobody told the program about).
    jpeg
        Quality 1..100, or None for no compression; 8 bits only.
    subsampling
        Of the JPEG's color: "4:4:4" or "4:2:0".
    seed
        Of the noise: the same camera takes the same picture twice.
    """

    exposure: float = 1.0
    electrons: float = 30_000.0
    read_noise: float = 5.0
    bits: int = 8
    curve: Curve = "srgb"
    jpeg: int | None = None
    subsampling: Literal["4:4:4", "4:2:0"] = "4:2:0"
    seed: int = 0

    def __post_init__(self) -> None:
        if self.bits not in (8, 12, 16):
            raise ValueError(f"A camera has 8, 12 or 16 bits, not {self.bits}.")
        if self.jpeg is not None and self.bits != 8:
            raise ValueError("JPEG holds 8 bits: set bits=8 or leave jpeg out.")

    def expose(self, light: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return what the sensor reads, before clipping at 1: (H, W, 3) of light to the same shape.

        Light below zero (a saturated color outside the primaries) has no photons, but its mean survives: noise is
        that of the absolute value.
        """
        signal = np.asarray(light, np.float64) * self.exposure
        if not np.isfinite(self.electrons):
            return signal
        rng = np.random.default_rng(self.seed)
        shot = rng.standard_normal(signal.shape) * np.sqrt(np.abs(signal) / self.electrons)
        return signal + shot + rng.standard_normal(signal.shape) * (self.read_noise / self.electrons)

    def shoot(self, light: NDArray[np.floating]) -> NDArray[np.uint8] | NDArray[np.uint16]:
        """Take a picture.

        Parameters
        ----------
        light
            (H, W, 3) scene-linear RGB.

        Returns
        -------
        (H, W, 3) codes, uint8, or uint16 for 12 and 16 bits.
        """
        codes = np.clip(self.expose(light), 0.0, 1.0)
        if self.curve != "linear":
            codes = transfer.SRGB.encode(codes)
        if self.curve == "tone":
            codes = tone(codes)
        top = 2**self.bits - 1
        steps = np.floor(codes * top + 0.5)
        if self.bits == 8:
            picture = steps.astype(np.uint8)
            return picture if self.jpeg is None else _through_jpeg(picture, self.jpeg, self.subsampling)
        return np.round(steps * (65535 / top)).astype(np.uint16)

    def linear(self, codes: NDArray[np.unsignedinteger]) -> NDArray[np.float32]:
        """Decode a picture as a program would that knows no more than the file says.

        Parameters
        ----------
        codes
            What `shoot` returned.

        Returns
        -------
        (H, W, 3) float32, in units of the scene (exposure undone). A "tone" curve is not undone: no file tells it.
        """
        curve = transfer.LINEAR if self.curve == "linear" else transfer.SRGB
        return transfer.decode(codes, curve) / np.float32(self.exposure)

    def photograph(self, light: NDArray[np.floating]) -> NDArray[np.float32]:
        """Take a picture and decode it: `linear` of `shoot`."""
        return self.linear(self.shoot(light))


def _through_jpeg(picture: NDArray[np.uint8], quality: int, subsampling: str) -> NDArray[np.uint8]:
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, "JPEG", quality=quality, subsampling=subsampling)
    with Image.open(stream) as image:
        return np.asarray(image.convert("RGB"))
