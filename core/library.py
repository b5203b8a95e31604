"""Libraries of swatches, and finding one in them by name or by color."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import colorimetry, gamut
from .colorspace import SRGB
from .errors import TargetError
from .swatches import Encoded, Swatch, lab_of


@dataclass(frozen=True)
class Group:
    """Swatches that belong together; a file without groups has one without a name."""

    name: str
    swatches: tuple[Swatch, ...]


@dataclass(frozen=True, eq=False)
class Library:
    """Swatches in their order.

    Attributes
    ----------
    name
        As shown to the user.
    groups
        In the order of the file.
    notes
        Sentences on what was assumed when it was read, and on what could not be.
    """

    name: str
    groups: tuple[Group, ...]
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, swatches: Iterable[Swatch], notes: Iterable[str] = ()) -> Library:
        """Make a library of one group without a name."""
        return cls(name, (Group("", tuple(swatches)),), tuple(notes))

    @classmethod
    def from_linear_colors(
        cls, name: str, colors: ArrayLike, names: Sequence[str] = (), space: str = "linear-srgb"
    ) -> Library:
        """Make a library of linear RGB (n, 3) of a space, as a Blender palette holds it.

        Parameters
        ----------
        name
            Of the library.
        colors
            (n, 3); may be negative and above 1.
        names
            Of the colors; those without one are numbered.
        space
            A linear one of `colorspace.SPACES`.
        """
        table = np.asarray(colors, np.float64).reshape(-1, 3)
        swatches = []
        for k, (red, green, blue) in enumerate(table.tolist()):
            swatches.append(
                Swatch(names[k] if k < len(names) else f"Color {k + 1}", Encoded((red, green, blue), space))
            )
        return cls.of(name, swatches)

    def __len__(self) -> int:
        return len(self.swatches)

    @cached_property
    def swatches(self) -> tuple[Swatch, ...]:
        """All swatches; the indices of this class count in them."""
        return tuple(swatch for group in self.groups for swatch in group.swatches)

    @cached_property
    def group_names(self) -> tuple[str, ...]:
        """Name of the group of each swatch."""
        return tuple(group.name for group in self.groups for _ in group.swatches)

    @cached_property
    def lab(self) -> NDArray[np.float64]:
        """(n, 3) L*a*b* under D50; made once, when first needed."""
        return lab_of(self.swatches)

    @cached_property
    def linear_colors(self) -> NDArray[np.float64]:
        """(n, 3) linear Rec.709, as a Blender palette wants it; outside 0..1 where sRGB does not hold the color."""
        white = colorimetry.white_xyz("D50")
        adapted = colorimetry.lab_to_xyz(self.lab, white) @ colorimetry.adaptation_matrix(white, SRGB.white).T
        return colorimetry.xyz_to_linear(adapted, SRGB)

    @cached_property
    def display_colors(self) -> NDArray[np.float32]:
        """(n, 3) sRGB codes, 0..1, to show the swatches by; paler where sRGB does not hold them."""
        linear = self.linear_colors.astype(np.float32)
        gamut.fit_to_gamut(linear)
        return SRGB.curve.encode(np.clip(linear, 0, 1)).astype(np.float32)

    @cached_property
    def _texts(self) -> list[str]:
        pairs = zip(self.group_names, self.swatches, strict=True)
        return [f"{group} {swatch.text}".casefold() for group, swatch in pairs]

    def search(self, text: str) -> list[int]:
        """Indices of the swatches whose name or group holds every word of a text, in any case."""
        words = text.casefold().split()
        return [k for k, name in enumerate(self._texts) if all(word in name for word in words)]

    def subset(self, indices: Sequence[int]) -> Library:
        """Return a library of some of the swatches, in the order of the indices, with the names of their groups."""
        groups: dict[str, list[Swatch]] = {}
        for k in indices:
            groups.setdefault(self.group_names[k], []).append(self.swatches[k])
        return Library(self.name, tuple(Group(name, tuple(kept)) for name, kept in groups.items()), self.notes)

    def nearest(self, color: Swatch | ArrayLike, count: int = 10) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Find the swatches nearest to a color.

        Parameters
        ----------
        color
            A swatch, or (3,) L*a*b* under D50.
        count
            How many.

        Returns
        -------
        indices
            (min(count, n),) of the swatches, the nearest first.
        differences
            Their CIEDE2000 from the color.
        """
        lab = color.to_lab() if isinstance(color, Swatch) else np.asarray(color, np.float64)
        differences = colorimetry.delta_e_2000(lab, self.lab)
        order = np.argsort(differences, kind="stable")[:count]
        return order, differences[order]

    def named(self, name: str) -> Swatch:
        """Find a swatch by its name in any case, or by its group and name as ``group/name``.

        Raises
        ------
        TargetError
            If there is none of that name.
        """
        wanted = name.strip().casefold()
        for group, swatch in zip(self.group_names, self.swatches, strict=True):
            if wanted in (swatch.text.casefold(), f"{group}/{swatch.text}".casefold()):
                return swatch
        names = {swatch.text.casefold(): swatch.text for swatch in self.swatches}
        near = [names[key] for key in difflib.get_close_matches(wanted, names, 3, 0.4)] or list(names.values())[:3]
        raise TargetError(f"Library '{self.name}' has no swatch '{name.strip()}': it has {', '.join(near)}.")
