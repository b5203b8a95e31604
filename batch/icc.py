"""ICC profiles of the matrix/TRC kind (ICC.1:2022, 8.3.3 and 8.4.3), read and written.

Three colorants and one tone curve say everything Dyehouse needs to turn codes into light. Profiles built on
lookup tables do not, and are refused by name rather than guessed at.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core import transfer
from ..core.colorspace import SPACES, RGBSpace
from ..core.errors import FileError

PCS_WHITE = np.array([0.9642, 1.0, 0.8249])  # ICC.1:2022, 7.2.16: the D50 of the connection space
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])

# Profiles of one space differ between vendors by rounding and by how their white was adapted.
_MATRIX_TOLERANCE = 2e-3
# The closest pair that must stay apart is the sRGB curve and a plain power of 2.2: 0.0078 at its widest.
_CURVE_TOLERANCE = 1.5e-3
_GRID = np.linspace(0, 1, 1025)
_REMEDY = "give its color space with --color-space"


def bradford(source: ArrayLike, target: ArrayLike) -> NDArray[np.float64]:
    """Return the chromatic adaptation of XYZ from one white to another (ICC.1:2022, annex E).

    Parameters
    ----------
    source, target
        (3,) XYZ of the two whites.

    Returns
    -------
    (3, 3) float64
    """
    gain = (_BRADFORD @ np.asarray(target)) / (_BRADFORD @ np.asarray(source))
    return np.linalg.inv(_BRADFORD) @ (gain[:, None] * _BRADFORD)


def parse(profile: bytes, color_space: str = "RGB") -> RGBSpace:
    """Read the primaries and the curve of an RGB profile, version 2 or 4.

    A profile that equals one of `core.colorspace.SPACES` within the rounding of such files gives that very
    space, so that results do not depend on who wrote the profile. The comparison is made in the connection
    space (D50), because there all vendors agree. Any other profile is brought back to its own white: by the
    inverse of its ``chad`` tag; without one, by Bradford to its ``wtpt``, because version 2 display profiles
    keep the white of the display there and adapt the colorants only. A ``wtpt`` of D50 means a white of D50.

    Parameters
    ----------
    profile
        The bytes of the profile.
    color_space
        Signature of the data the profile must be for.

    Returns
    -------
    RGBSpace

    Raises
    ------
    FileError
        If the profile is damaged, is not for RGB, holds lookup tables only, or has another curve per channel.
    """
    try:
        return _parse(profile, color_space)
    except (struct.error, IndexError, OverflowError, np.linalg.LinAlgError):
        raise FileError(f"The ICC profile is damaged: {_REMEDY}.") from None


def data_space(profile: bytes) -> str:
    """Return the signature of the data a profile is for, such as ``RGB``, ``GRAY`` or ``CMYK`` (7.2.8)."""
    return profile[16:20].decode("latin-1").strip()


def description(profile: bytes) -> str:
    """Return the name a profile gives itself, or an empty string (tag ``desc`` of either version)."""
    try:
        body = _tags(profile).get("desc", b"")
        if body[:4] == b"desc":
            length = struct.unpack_from(">I", body, 8)[0]
            text = body[12 : 12 + length].decode("latin-1")
        elif body[:4] == b"mluc":
            length, offset = struct.unpack_from(">II", body, 20)
            text = body[offset : offset + length].decode("utf-16-be", "replace")
        else:
            return ""
    except (struct.error, FileError):
        return ""
    return "".join(c for c in text if c.isprintable()).strip()[:80]


def _tags(profile: bytes) -> dict[str, bytes]:
    if len(profile) < 132 or profile[36:40] != b"acsp":
        raise FileError(f"The ICC profile is damaged: {_REMEDY}.")
    count = struct.unpack_from(">I", profile, 128)[0]
    if count > 1000:
        raise FileError(f"The ICC profile is damaged: {_REMEDY}.")
    tags = {}
    for i in range(count):
        name, offset, size = struct.unpack_from(">4sII", profile, 132 + 12 * i)
        body = profile[offset : offset + size]
        if len(body) != size:
            raise FileError(f"The ICC profile is cut short: {_REMEDY}.")
        tags[name.decode("latin-1")] = body
    return tags


def _parse(profile: bytes, color_space: str) -> RGBSpace:
    tags = _tags(profile)
    found = data_space(profile)
    if found != color_space:
        raise FileError(f"The ICC profile is for {found!r} data and not for {color_space}: {_REMEDY}.")
    name = description(profile) or "ICC profile"
    needed = ("rXYZ", "gXYZ", "bXYZ", "rTRC", "gTRC", "bTRC")
    if any(tag not in tags for tag in needed):
        kind = "lookup tables" if any(tag in tags for tag in ("A2B0", "A2B1", "D2B0")) else "something else"
        raise FileError(
            f"The ICC profile '{name}' is made of {kind} and not of three primaries and a curve: {_REMEDY}."
        )
    if profile[20:24] != b"XYZ ":
        raise FileError(f"The ICC profile '{name}' does not connect through XYZ: {_REMEDY}.")

    colorants = np.column_stack([_xyz(tags[tag]) for tag in needed[:3]])
    if np.abs(colorants.sum(axis=1) - PCS_WHITE).max() > 0.02:
        raise FileError(f"The primaries of the ICC profile '{name}' do not add up to white: {_REMEDY}.")
    if np.linalg.cond(colorants) > 1e4:
        raise FileError(f"The primaries of the ICC profile '{name}' are not three colors: {_REMEDY}.")
    curves = [_curve(tags[tag], name) for tag in needed[3:]]
    levels = [curve.decode(_GRID) for curve in curves]
    if max(np.abs(levels[0] - levels[1]).max(), np.abs(levels[1] - levels[2]).max()) > _CURVE_TOLERANCE:
        raise FileError(
            f"The ICC profile '{name}' has a different curve for each channel, which is not read: {_REMEDY}."
        )
    curve = _plain(curves[1])

    for space in SPACES.values():
        if same_curve(space.curve, curve) and np.abs(_to_pcs(space) - colorants).max() < _MATRIX_TOLERANCE:
            return space
    to_xyz = _from_pcs(tags, name) @ colorants
    return RGBSpace(name, to_xyz / to_xyz[1].sum(), curve)


def same_curve(one: transfer.Curve, other: transfer.Curve) -> bool:
    """Tell whether two curves give the same light for every code, within the rounding of profiles."""
    return bool(np.abs(one.decode(_GRID) - other.decode(_GRID)).max() < _CURVE_TOLERANCE)


def _plain(curve: transfer.Curve) -> transfer.Curve:
    """Replace a curve by the standard one it only repeats in samples or in rounded numbers."""
    for known in (transfer.LINEAR, transfer.SRGB, transfer.ADOBE_RGB, transfer.REC_2020, transfer.PROPHOTO):
        if np.abs(known.decode(_GRID) - curve.decode(_GRID)).max() < 2e-4:
            return known
    return curve


def _to_pcs(space: RGBSpace) -> NDArray[np.float64]:
    return bradford(space.white, PCS_WHITE) @ space.to_xyz


def _from_pcs(tags: dict[str, bytes], name: str) -> NDArray[np.float64]:
    """(3, 3): XYZ of the connection space to XYZ under the white of the profile."""
    if "chad" in tags:
        if tags["chad"][:4] != b"sf32":
            raise struct.error
        chad = np.array(struct.unpack_from(">9i", tags["chad"], 8)).reshape(3, 3) / 65536
        if np.linalg.cond(chad) > 100:
            raise FileError(f"The chromatic adaptation of the ICC profile '{name}' is damaged: {_REMEDY}.")
        return np.linalg.inv(chad)
    white = _xyz(tags["wtpt"]) if "wtpt" in tags else PCS_WHITE
    if white.min() < 0.2 or white.max() > 2:
        raise FileError(f"The white of the ICC profile '{name}' is damaged: {_REMEDY}.")
    return bradford(PCS_WHITE, white)


def _xyz(body: bytes) -> NDArray[np.float64]:
    if body[:4] != b"XYZ ":
        raise struct.error
    return np.array(struct.unpack_from(">3i", body, 8)) / 65536


_PARAMETERS = (1, 3, 4, 5, 7)  # of function types 0 to 4 (ICC.1:2022, table 68)


def _curve(body: bytes, name: str) -> transfer.Curve:
    curve: transfer.Curve
    kind = body[:4]
    if kind == b"curv":
        count = struct.unpack_from(">I", body, 8)[0]
        if count > 65536:
            raise struct.error
        values = struct.unpack_from(f">{count}H", body, 12)
        if count == 0:
            return transfer.LINEAR
        if count == 1:
            curve = transfer.ParametricCurve(values[0] / 256)
        else:
            curve = transfer.SampledCurve(tuple(v / 65535 for v in values))
    elif kind == b"para":
        function = struct.unpack_from(">H", body, 8)[0]
        if function >= len(_PARAMETERS):
            raise struct.error
        p = [v / 65536 for v in struct.unpack_from(f">{_PARAMETERS[function]}i", body, 12)]
        if function == 0:
            curve = transfer.ParametricCurve(p[0])
        elif function < 3:
            knee = -p[2] / p[1] if p[1] else 0.0
            foot = p[3] if function == 2 else 0.0
            curve = transfer.ParametricCurve(p[0], p[1], p[2], d=knee, e=foot, f=foot)
        else:
            curve = transfer.ParametricCurve(*p)
    else:
        raise struct.error
    if isinstance(curve, transfer.ParametricCurve) and not (curve.g > 0 and curve.a > 0):
        raise FileError(f"The curve of the ICC profile '{name}' cannot be inverted: {_REMEDY}.")
    with np.errstate(all="ignore"):
        light = curve.decode(_GRID)
    sound = np.isfinite(light).all() and np.diff(light).min() > -1e-4 and 0.5 < light[-1] - light[0] < 1.1
    if not sound:
        raise FileError(f"The curve of the ICC profile '{name}' cannot be inverted: {_REMEDY}.")
    return curve


def write_profile(space: RGBSpace) -> bytes:
    """Make a version 4 display profile of an RGB space (ICC.1:2022, 8.4.3).

    Parameters
    ----------
    space
        Its primaries are adapted to D50 by Bradford, and the adaptation goes into ``chad``.

    Returns
    -------
    bytes
        What `parse` reads as the same space.
    """
    chad = bradford(space.white, PCS_WHITE)
    colorants = chad @ space.to_xyz
    curve = space.curve
    if isinstance(curve, transfer.SampledCurve):
        samples = [round(65535 * min(max(v, 0.0), 1.0)) for v in curve.samples]
        trc = b"curv" + bytes(4) + struct.pack(f">I{len(samples)}H", len(samples), *samples)
    elif curve.is_linear:
        trc = b"curv" + bytes(8)
    else:
        numbers = (curve.g, curve.a, curve.b, curve.c, curve.d, curve.e, curve.f)
        trc = b"para" + bytes(4) + struct.pack(">HH", 4, 0) + _fixed(numbers)
    tags = {
        "desc": _text(space.name),
        "cprt": _text("CC0"),
        "wtpt": b"XYZ " + bytes(4) + _fixed(PCS_WHITE),
        "chad": b"sf32" + bytes(4) + _fixed(chad.ravel()),
        "rXYZ": b"XYZ " + bytes(4) + _fixed(colorants[:, 0]),
        "gXYZ": b"XYZ " + bytes(4) + _fixed(colorants[:, 1]),
        "bXYZ": b"XYZ " + bytes(4) + _fixed(colorants[:, 2]),
        "rTRC": trc,
        "gTRC": trc,
        "bTRC": trc,
    }
    table, data = b"", b""
    start = 132 + 12 * len(tags)
    places: dict[bytes, int] = {}
    for name, body in tags.items():
        if body not in places:
            places[body] = start + len(data)
            data += body + bytes(-len(body) % 4)
        table += struct.pack(">4sII", name.encode(), places[body], len(body))
    header = struct.pack(
        ">I4sI4s4s4s6H4s4sI4sIQI",
        start + len(data), b"", 0x04300000, b"mntr", b"RGB ", b"XYZ ",
        2026, 1, 1, 0, 0, 0, b"acsp", b"", 0, b"", 0, 0, 0,
    )  # fmt: skip
    header += _fixed(PCS_WHITE) + bytes(128 - len(header) - 12)
    return header + struct.pack(">I", len(tags)) + table + data


def _fixed(values: ArrayLike) -> bytes:
    numbers = np.floor(np.asarray(values, np.float64) * 65536 + 0.5).astype(int)
    return struct.pack(f">{numbers.size}i", *numbers.tolist())


def _text(text: str) -> bytes:
    data = text.encode("utf-16-be")
    return b"mluc" + bytes(4) + struct.pack(">II4sII", 1, 12, b"enUS", len(data), 28) + data
