"""Continue branches in the cam speed."""

from typing import TYPE_CHECKING

import numpy as np

from ...models import rad_s_to_rpm, rpm_to_rad_s


if TYPE_CHECKING:
    from continuation import Branch


START_RPM = 145.0
"""Speed at which branches start (rpm)."""


def bounds(ends: tuple[float, float]) -> tuple[float, float]:
    """Convert bounds of the cam speed from rpm to rad/s."""
    low, high = (float(rpm_to_rad_s(end)) for end in ends)
    return low, high


def special_speed(branch: "Branch", kind: str) -> float:
    """Return the speed (rpm) of the first special point of the given kind."""
    found = [point.parameter for point in branch.special if point.kind == kind]
    return float(rad_s_to_rpm(found[0])) if found else np.nan
