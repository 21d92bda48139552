"""Check that the momentum of two colliding bodies is conserved."""

import dataclasses
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ..recordings import ImpactTable


# Limits of the momentum error, in standard errors and as a fraction of the exchanged
# momentum
_ERRORS, _SHARE = 3.0, 0.005


@dataclasses.dataclass(frozen=True)
class MomentumBalance:
    """Momentum balance of two bodies in their impacts."""

    change: float
    """Change of the total momentum, relative to the momentum exchanged; NaN if the
    masses are unknown.
    """
    stderr: float
    """Standard error of `change`."""
    ratio: float
    """Ratio of the second mass to the first for which momentum is conserved."""
    ratio_stderr: float
    """Standard error of `ratio`."""
    stated: float
    """Ratio of the stated masses, or NaN."""

    @property
    def kept(self) -> bool:
        """Return whether the change is within its error, or too small to matter."""
        size = abs(self.change)
        return not (size > _ERRORS * self.stderr and size > _SHARE)

    def sentence(self) -> str:
        """Return the momentum balance in words."""
        ratio = f"{self.ratio:.4g} +- {self.ratio_stderr:.1g}"
        if np.isnan(self.stated):
            return (
                f"If momentum is conserved, the second mass is {ratio} times the first."
            )
        change = f"{self.change:+.2%} +- {self.stderr:.1%} of the exchanged momentum"
        if self.kept:
            return f"Momentum is conserved: the total changes by {change}."
        return (
            f"Momentum is not conserved: the total changes by {change}. It would be "
            f"conserved for a mass ratio of {ratio} instead of {self.stated:.4g}; "
            f"check the masses, the scale of either speed, and other forces."
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain numbers, `None` for unknown ones."""
        fields = dataclasses.asdict(self)
        return {
            name: None if np.isnan(value) else value for name, value in fields.items()
        }


def momentum_of(
    table: ImpactTable, keep: Bool[np.ndarray, " k"]
) -> MomentumBalance | None:
    """Return the momentum balance of some impacts; `None` for a single body."""
    if table.bodies is None:
        return None
    bodies = table.bodies
    change = (bodies.after - bodies.before)[keep]
    # the first body loses the momentum that the second gains
    sign = np.where(change[:, 0] < 0, 1.0, -1.0)
    first, second = -sign * change[:, 0], sign * change[:, 1]
    ratio, error = _ratio(first, second)
    if bodies.mass is None:
        return MomentumBalance(np.nan, np.nan, ratio, error, np.nan)
    mass = bodies.mass[keep]
    given, taken = mass[:, 0] * first, mass[:, 1] * second
    share, stderr = _ratio(taken, given)
    stated = float(np.median(mass[:, 1] / mass[:, 0]))
    return MomentumBalance(share - 1.0, stderr, ratio, error, stated)


def _ratio(
    above: Float[np.ndarray, " k"], below: Float[np.ndarray, " k"]
) -> tuple[float, float]:
    """Return the ratio of two sums, with the standard error from their scatter."""
    total = float(np.sum(below))
    if total == 0 or len(above) < 2:
        return np.nan, np.nan
    ratio = float(np.sum(above)) / total
    scatter = float(np.sum((above - ratio * below) ** 2)) * len(above)
    return ratio, float(np.sqrt(scatter / (len(above) - 1))) / abs(total)
