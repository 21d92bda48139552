"""Terms whose constants are derived from the recorded motion."""

import dataclasses
from typing import ClassVar

import equinox as eqx

from ._motion_scales import MotionScales
from ._term import Strength, Term


class ScaledTerm(Term):
    """A term whose constants (ranges, speeds, accelerations) come from the recordings.

    Subclasses give the size of each strength in `_sizes`, and the bounds of each inner
    parameter in `_ends`.
    """

    # the scales as plain numbers, which a saved system can store
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
        # until they are fitted, inner parameters have the middle starting value
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
        """Return the strengths as declared by their fields."""
        return super().strengths()

    def _sizes(self) -> dict[str, float]:
        """Return the size of a significant change of each strength."""
        return {}

    def _ends(self) -> dict[str, tuple[float, float]]:
        """Return the smallest and largest value of each inner parameter."""
        return {}
