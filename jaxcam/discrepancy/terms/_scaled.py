"""Terms whose forms have places of their own, scaled from what recordings visit."""

import dataclasses
from typing import ClassVar

import equinox as eqx

from ._motion_scales import MotionScales
from ._term import Strength, Term


class ScaledTerm(Term):
    """A term whose constants come from the recordings: ranges, speeds, accelerations.

    Subclasses say the size of each strength in `_sizes`, and the ends of each inner
    one in `_ends`.
    """

    # plain numbers, as a saved system holds them
    ranges: tuple[float, ...] = eqx.field(
        default=tuple(MotionScales()),
        static=True,
        kw_only=True,
        metadata={"spare": True},
    )
    listed: ClassVar[bool] = True

    @property
    def scales(self) -> MotionScales:
        """Scales of the motion in the recordings."""
        return MotionScales(*self.ranges)

    def scaled(self, scales: MotionScales) -> "ScaledTerm":
        found = dataclasses.replace(self, ranges=tuple(scales))
        starts = found.starts()
        # somewhere in the range, until a fit says where
        inner = starts[len(starts) // 2] if starts else {}
        return dataclasses.replace(found, **inner)

    def strengths(self) -> tuple[Strength, ...]:
        sizes, ends = self._sizes(), self._ends()
        return tuple(
            dataclasses.replace(
                one,
                size=sizes.get(one.name, one.size),
                lower=ends[one.name][0] if one.name in ends else one.lower,
                upper=ends[one.name][1] if one.name in ends else one.upper,
            )
            for one in self._declared()
        )

    def _declared(self) -> tuple[Strength, ...]:
        """The strengths as their fields state them."""
        return super().strengths()

    def _sizes(self) -> dict[str, float]:
        """Changes of the strengths that matter."""
        return {}

    def _ends(self) -> dict[str, tuple[float, float]]:
        """Least and largest value of inner numbers."""
        return {}
