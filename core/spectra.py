"""Spectra: light, reflectance, the CIE observers and cameras, and what each makes of the other.

Wavelengths are in nm. Light is interpolated linearly, as CIE 15:2018 has it; reflectances and sensitivities
by Sprague's fifth-order polynomial where they are equally spaced and by a cubic spline where not (CIE
167:2005). Beyond their ends light and reflectances keep their last value. Integrals are sums at 1 nm: with
the observers over 360..830 nm, with a camera over the range its sensitivities are known for.

Tables come from `tables/spectra.npz`, written by `benchmarks/export_tables.py` and read once, when first
needed.
"""

from __future__ import annotations

import csv
import difflib
import re
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import FileError, WhiteError


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One or several functions of wavelength.

    Attributes
    ----------
    wavelengths
        (n,) float64, in nm, increasing.
    values
        (n,) float64, or (n, m) for m functions (the three of an observer or a camera). Reflectance is 0..1;
        the power of light and the sensitivity of a camera have any scale.
    name
        As shown to the user.
    """

    wavelengths: NDArray[np.float64]
    values: NDArray[np.float64]
    name: str = ""

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Spectrum)
            and np.array_equal(self.wavelengths, other.wavelengths)
            and np.array_equal(self.values, other.values)
        )

    def __hash__(self) -> int:
        return hash((self.wavelengths.tobytes(), self.values.tobytes()))

    def at(self, wavelengths: ArrayLike, linear: bool = False) -> NDArray[np.float64]:
        """Values at other wavelengths, the end values being kept beyond the ends.

        Parameters
        ----------
        wavelengths
            (k,), in nm.
        linear
            Interpolate linearly, as for light; else by CIE 167:2005, as for reflectances and sensitivities.
            Fewer than six samples are always interpolated linearly.

        Returns
        -------
        (k,) or (k, m) float64.
        """
        x = np.clip(np.asarray(wavelengths, np.float64), self.wavelengths[0], self.wavelengths[-1])
        steps = np.diff(self.wavelengths)
        if linear or len(self.wavelengths) < 6:
            columns = self.values.reshape(len(self.wavelengths), -1).T
            result = np.column_stack([np.interp(x, self.wavelengths, column) for column in columns])
            return result.reshape(x.shape + self.values.shape[1:])
        if np.allclose(steps, steps[0], rtol=1e-6):
            return _sprague(self.wavelengths, self.values, x)
        return _cubic_spline(self.wavelengths, self.values, x)


# CIE 167:2005: the two values added at either end (times 209), and the polynomial (times 24).
_SPRAGUE_ENDS = np.array(
    [
        [884, -1960, 3033, -2648, 1080, -180],
        [508, -540, 488, -367, 144, -24],
        [-24, 144, -367, 488, -540, 508],
        [-180, 1080, -2648, 3033, -1960, 884],
    ]
)
_SPRAGUE = np.array(
    [
        [0, 0, 24, 0, 0, 0],
        [2, -16, 0, 16, -2, 0],
        [-1, 16, -30, 16, -1, 0],
        [-9, 39, -70, 66, -33, 7],
        [13, -64, 126, -124, 61, -12],
        [-5, 25, -50, 50, -25, 5],
    ]
)


def _sprague(x: NDArray, y: NDArray, new: NDArray) -> NDArray[np.float64]:
    before = np.tensordot(_SPRAGUE_ENDS[:2] / 209, y[:6], 1)
    after = np.tensordot(_SPRAGUE_ENDS[2:] / 209, y[-6:], 1)
    padded = np.concatenate([before, y, after])
    place = (new - x[0]) / (x[1] - x[0])
    interval = np.clip(place.astype(int), 0, len(x) - 2)
    powers = np.vander(place - interval, 6, increasing=True)
    return np.einsum("kp,ps,ks...->k...", powers, _SPRAGUE / 24, padded[interval[:, None] + np.arange(6)])


def _cubic_spline(x: NDArray, y: NDArray, new: NDArray) -> NDArray[np.float64]:
    """Interpolate by a cubic spline whose outermost two pieces are one polynomial ("not a knot")."""
    h = np.diff(x)
    n = len(x)
    system = np.zeros((n, n))  # for the second derivatives at x
    inner = np.arange(1, n - 1)
    system[inner, inner - 1] = h[:-1]
    system[inner, inner] = 2 * (h[:-1] + h[1:])
    system[inner, inner + 1] = h[1:]
    system[0, :3] = h[1], -(h[0] + h[1]), h[0]
    system[-1, -3:] = h[-1], -(h[-2] + h[-1]), h[-2]
    h = h.reshape(-1, *[1] * (y.ndim - 1))
    slopes = np.diff(y, axis=0) / h
    bends = np.zeros_like(y)
    bends[1:-1] = 6 * np.diff(slopes, axis=0)
    bends = np.linalg.solve(system, bends.reshape(n, -1)).reshape(y.shape)

    i = np.clip(np.searchsorted(x, new, side="right") - 1, 0, n - 2)
    t = (new - x[i]).reshape(-1, *[1] * (y.ndim - 1))
    first = slopes[i] - h[i] * (2 * bends[i] + bends[i + 1]) / 6
    return y[i] + t * (first + t * (bends[i] / 2 + t * (bends[i + 1] - bends[i]) / (6 * h[i])))


@cache
def _tables() -> dict[str, NDArray]:
    with np.load(Path(__file__).parent / "tables" / "spectra.npz") as file:
        return {name: file[name] for name in file.files}


def _table(key: str, name: str) -> Spectrum:
    table = _tables()[key]
    values = table[:, 1] if table.shape[1] == 2 else table[:, 1:]
    return Spectrum(table[:, 0], values, name)


def _names(kind: str) -> list[str]:
    return [key.removeprefix(f"{kind}/") for key in _tables() if key.startswith(f"{kind}/")]


def illuminant_names() -> list[str]:
    """Names of the tabulated illuminants, such as "A", "D65", "FL11" and "LED-B3"."""
    return _names("illuminant")


def camera_names() -> list[str]:
    """Names of the cameras with built-in sensitivities."""
    return _names("camera")


def chart(name: str = "ISO 17321-1") -> dict[str, Spectrum]:
    """Reflectances of the patches of a chart, by the name of the patch.

    Parameters
    ----------
    name
        Of the ColorChecker "ISO 17321-1", "ColorChecker N Ohta" or "BabelColor Average"; of test colors "CIE 13.3" or
        "NIST CQS".
    """
    table = _tables()[f"chart/{name}"]
    patches = _tables()[f"patches/{name}"]
    return {
        str(patch): Spectrum(table[:, 0], column, str(patch))
        for patch, column in zip(patches, table[:, 1:].T, strict=True)
    }


@cache
def observer(name: str = "1931") -> Spectrum:
    """Color-matching functions of a CIE standard observer.

    Parameters
    ----------
    name
        "1931" (or "2") for the 2° observer, "1964" (or "10") for the 10° one.

    Returns
    -------
    360..830 nm at 1 nm, values (471, 3).

    Raises
    ------
    WhiteError
        If there is no such observer.
    """
    year = {"2": "1931", "10": "1964"}.get(name.strip(" °"), name)
    if year not in ("1931", "1964"):
        raise WhiteError(f"Observer '{name}' is not known: use 2 (CIE 1931) or 10 (CIE 1964) degrees.")
    return _table(f"observer/{year}", f"CIE {year}")


def _plain(name: str) -> str:
    """A name without what people write differently: case, blanks, hyphens, "CIE"."""
    return re.sub(r"[\s_()-]", "", name.upper()).removeprefix("CIE")


def illuminant(name: str | float | Spectrum) -> Spectrum:
    """Light by its name, its temperature, a file, or as a mixture of these.

    Parameters
    ----------
    name
        A CIE name in any spelling ("D65", "d 65", "FL11", "F11", "LED-B3"), a daylight that is not tabulated
        ("D93"); a temperature ("5600K", "2856 K", a number), which from 4000 K up means CIE daylight and below it a
        black body; "blackbody 6500K" and "daylight 5000K" say which; a CSV file of wavelength and power; or several
        of these with their shares of the luminance ("0.7 D65 + 0.3 A", "60% 3200K + 40% FL11"; without shares they
        are equal). A `Spectrum` is returned as it is.

    Returns
    -------
    Relative power, 100 at 560 nm where computed, Y = 100 for a mixture.

    Raises
    ------
    WhiteError
        If there is no such light, or the temperature is out of range.
    FileError
        If a file cannot be understood.
    """
    if isinstance(name, Spectrum):
        return name
    text = str(name).strip()
    is_file = text.lower().endswith(".csv")
    if "+" in text and not (is_file and Path(text).is_file()):
        return _mixture(text)
    if is_file:
        return _measured_light(text)
    plain = _plain(text)
    if match := re.fullmatch(r"(BLACKBODY|DAYLIGHT)?(\d+(?:\.\d*)?)K?", plain):
        return _light_of_temperature(float(match[2]), match[1])
    plain = re.sub(r"^F(?=\d)", "FL", plain)
    known = {_plain(key): key for key in illuminant_names()}
    if plain in known:
        return _table(f"illuminant/{known[plain]}", known[plain])
    # D93 and the like: the nominal temperature was rounded before the constant c2 of Planck's law changed.
    if (match := re.fullmatch(r"D(\d{2,3})", plain)) and 40 <= int(match[1]) <= 250:
        return Spectrum(*_daylight(int(match[1]) * 100 * 1.4388 / 1.4380), f"D{match[1]}")
    near = [known[key] for key in difflib.get_close_matches(plain, known, 3, 0.5)] or [
        "D65",
        "D50",
        "A",
        "FL11",
    ]
    raise WhiteError(
        f"Illuminant '{name}' is not known: use {', '.join(near)}, another CIE name, or a color temperature "
        "such as 5600K."
    )


def _mixture(text: str) -> Spectrum:
    wavelengths, y_bar = observer().wavelengths, observer().values[:, 1]
    shares, lights = [], []
    for term in text.split("+"):
        match = re.fullmatch(r"\s*(\d+\.?\d*|\.\d+)(?:\s*(%)\s*|\s*[*×]\s*|\s+)(\S.*?)\s*", term)
        if match is None or match[3] in ("K", "k"):  # "2856 K" is a temperature
            share, name = None, term.strip()
        else:
            share, name = float(match[1]) / (100 if match[2] else 1), match[3]
        shares.append(share)
        lights.append(illuminant(name))
    given = [1.0 if share is None else share for share in shares]
    if sum(given) <= 0 or (None in shares and any(share is not None for share in shares)):
        raise WhiteError(f"Illuminant '{text}' lacks a share: write all of them, as in 0.7 D65 + 0.3 A.")
    total = np.zeros(len(wavelengths))
    for share, light in zip(given, lights, strict=True):
        power = light.at(wavelengths, linear=True)
        total += 100 * share / sum(given) * power / (power @ y_bar)
    return Spectrum(wavelengths, total, " + ".join(f"{s:g} {e.name}" for s, e in zip(given, lights, strict=True)))


def _measured_light(path: str) -> Spectrum:
    light = read_csv(path)
    if light.values.min() < 0 or light.values.max() <= 0:
        raise FileError(f"Light '{path}' has power below 0, or none at all: measure it again, or clip the noise to 0.")
    return light


def _light_of_temperature(kelvin: float, kind: str | None) -> Spectrum:
    """Black body or daylight; without a kind the one that is meant in this range."""
    low, high = {"BLACKBODY": (500, 100_000), "DAYLIGHT": (4000, 25_000), None: (1000, 25_000)}[kind]
    if not low <= kelvin <= high:
        what = f"{kind.capitalize()} " if kind else ""
        raise WhiteError(f"Color temperature {what}{kelvin:g}K is out of range: use {low} to {high} K.")
    kind = kind or ("DAYLIGHT" if kelvin >= 4000 else "BLACKBODY")
    plain = 1000 <= kelvin <= 25_000 and (kind == "DAYLIGHT") == (kelvin >= 4000)
    name = f"{kelvin:g} K" if plain else f"{kind.lower()} {kelvin:g} K"
    return Spectrum(*(_daylight if kind == "DAYLIGHT" else _black_body)(kelvin), name)


def _daylight(kelvin: float) -> tuple[NDArray, NDArray]:
    """CIE 15:2018, 4.1.2: daylight of 4000..25000 K."""
    if kelvin <= 7000:
        x = -4.6070e9 / kelvin**3 + 2.9678e6 / kelvin**2 + 0.09911e3 / kelvin + 0.244063
    else:
        x = -2.0064e9 / kelvin**3 + 1.9018e6 / kelvin**2 + 0.24748e3 / kelvin + 0.237040
    y = -3.000 * x**2 + 2.870 * x - 0.275
    scale = 0.0241 + 0.2562 * x - 0.7341 * y
    # The standard rounds the two factors, so that everyone's tables agree.
    m1 = np.round((-1.3515 - 1.7703 * x + 5.9114 * y) / scale, 3)
    m2 = np.round((0.0300 - 31.4424 * x + 30.0717 * y) / scale, 3)
    wavelengths, s0, s1, s2 = _tables()["daylight"].T
    return wavelengths, s0 + m1 * s1 + m2 * s2


def _black_body(kelvin: float) -> tuple[NDArray, NDArray]:
    """Planck's law with c2 of the ITS-90, 100 at 560 nm."""
    wavelengths = np.arange(300.0, 831.0)
    c2 = 1.4388e7  # nm K
    power = (560 / wavelengths) ** 5 * np.expm1(c2 / (560 * kelvin)) / np.expm1(c2 / (wavelengths * kelvin))
    return wavelengths, 100 * power


def camera_sensitivities(camera: str | Path | Spectrum) -> Spectrum:
    """Sensitivities of a camera's red, green and blue sensors, S_k of Eq. (9).

    Parameters
    ----------
    camera
        The name of a built-in camera, or enough of it to be unique ("nikon"); the path of a CSV file with the
        columns wavelength, red, green, blue; or a `Spectrum` with values (n, 3), returned as it is.

    Raises
    ------
    WhiteError
        If no built-in camera has that name.
    FileError
        If the file cannot be understood.
    """
    if isinstance(camera, Spectrum):
        return camera
    if str(camera).lower().endswith(".csv"):
        return read_csv(camera, columns=3)
    found = [name for name in camera_names() if _plain(str(camera)) in _plain(name)]
    if len(found) != 1:
        raise WhiteError(
            f"Camera '{camera}' is not known: use one of {', '.join(camera_names())}, or a .csv file of its "
            "sensitivities (wavelength, red, green, blue)."
        )
    return _table(f"camera/{found[0]}", found[0])


def covers(wavelengths: NDArray) -> bool:
    """Tell whether increasing wavelengths (n,) cover 400 to 700 nm in six steps or more: else a color is a guess."""
    return len(wavelengths) >= 7 and bool(wavelengths[0] <= 400 and wavelengths[-1] >= 700)


def read_csv(path: str | Path, columns: int = 1) -> Spectrum:
    """Read a spectrum from a CSV file of wavelength and value(s), one wavelength a line.

    A first line of words is a header; blank lines and lines starting with # are left out.

    Parameters
    ----------
    path
        The file. Fields are separated by commas, semicolons or tabs.
    columns
        How many values follow the wavelength.

    Returns
    -------
    Values (n,) for one column, else (n, columns).

    Raises
    ------
    FileError
        If the file cannot be read, a line has other than `columns` + 1 numbers, wavelengths do not increase,
        or they do not cover 400..700 nm in at least six steps.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"Spectrum '{path}' cannot be read ({error}): give a text file with a spectrum.") from error
    rows: list[list[float]] = []
    header_allowed = True
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        fields = next(csv.reader([re.sub(r"[;\t]", ",", line)]))
        try:
            row = [float(field) for field in fields if field.strip()]
        except ValueError:
            if header_allowed and not any(field.strip()[:1].isdigit() for field in fields):
                header_allowed = False
                continue
            row = []
        header_allowed = False
        example = "550" + ", 0.25" * columns
        if len(row) != columns + 1 or not np.isfinite(row).all():
            raise FileError(f"{path}, line {number} is '{line.strip()}': write numbers such as '{example}'.")
        if rows and row[0] <= rows[-1][0]:
            raise FileError(f"{path}, line {number}: wavelength {row[0]:g} does not increase: sort the lines.")
        rows.append(row)
    table = np.array(rows).reshape(-1, columns + 1)
    if not covers(table[:, 0]):
        raise FileError(f"Spectrum '{path}' does not cover 400 to 700 nm in six steps or more: measure all of it.")
    return Spectrum(table[:, 0], table[:, 1] if columns == 1 else table[:, 1:], path.stem)


def to_xyz(
    light: str | float | Spectrum, reflectance: Spectrum | None = None, observer_name: str = "1931"
) -> NDArray[np.float64]:
    """Tristimulus values of a reflectance under a light (CIE 15:2018, 7.1).

    Parameters
    ----------
    light
        Anything `illuminant` takes.
    reflectance
        Values (n,) or (n, m); None for the perfect diffuser.
    observer_name
        "1931" or "1964".

    Returns
    -------
    (3,) or (m, 3) float64, Y = 1 for the perfect diffuser.
    """
    return _response(observer(observer_name), 1, light, reflectance)


def to_camera(
    light: str | float | Spectrum, reflectance: Spectrum | None, camera: str | Path | Spectrum
) -> NDArray[np.float64]:
    """Response of a linear camera to a reflectance under a light, V_k of Eqs. (11) and (34) with c = 1.

    Parameters
    ----------
    light
        Anything `illuminant` takes.
    reflectance
        Values (n,) or (n, m); None for the perfect diffuser, which gives W_k of Eq. (31).
    camera
        Anything `camera_sensitivities` takes. Its three channels are taken to be red, green, blue.

    Returns
    -------
    (3,) or (m, 3) float64, normalized to a green response of 1 to the perfect diffuser.

    Raises
    ------
    WhiteError
        If the green sensor sees nothing of this light.
    """
    return _response(camera_sensitivities(camera), 1, light, reflectance)


def _response(
    sensors: Spectrum, unit: int, light: str | float | Spectrum, reflectance: Spectrum | None
) -> NDArray[np.float64]:
    """Responses at 1 nm, normalized to 1 in channel `unit` for the perfect diffuser."""
    wavelengths, lit = _weights(sensors, illuminant(light))
    white = lit.sum(axis=0)
    if white[unit] <= 0:
        raise WhiteError("The light gives the observer or camera nothing to see: use another illuminant.")
    if reflectance is None:
        return white / white[unit]
    if reflectance.values.size > len(reflectance.wavelengths) ** 2:
        # Interpolation is linear in the samples: for many reflectances it is done once, on the weights of the samples.
        samples = Spectrum(reflectance.wavelengths, np.eye(len(reflectance.wavelengths)))
        return reflectance.values.T @ (samples.at(wavelengths).T @ lit) / white[unit]
    return reflectance.at(wavelengths).T @ lit / white[unit]


@lru_cache(maxsize=64)
def _weights(sensors: Spectrum, light: Spectrum) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Wavelengths (n,) at 1 nm and what sensors see of a light there (n, channels), not to be modified."""
    wavelengths = np.arange(np.ceil(sensors.wavelengths[0]), np.floor(sensors.wavelengths[-1]) + 1)
    return wavelengths, light.at(wavelengths, linear=True)[:, None] * sensors.at(wavelengths)
