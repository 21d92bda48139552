"""Settings of path following, which do not change the branch itself."""

import dataclasses

import equinox as eqx
import numpy as np


class BranchSettings(eqx.Module):
    """Accuracy and step control of a branch.

    The square of the length of a step is the mean square change of the state, in units
    of `problem.scale`, plus the square of the change of the parameter, in units of the
    distance between its bounds. For example, a step of 0.01 in the parameter alone is a
    hundredth of this distance.

    Examples:
        >>> import continuation
        >>> continuation.BranchSettings(max_step=0.02).max_step
        0.02
    """

    tolerance: float = 1e-10
    """Newton's iteration ends when the correction, relative to the scales, is smaller
    than this value; the remaining error is about the square of the value.
    """
    max_iterations: int = 8
    """Maximum number of corrector iterations; if more are needed, the step is
    reduced.
    """
    iterations: int = 4
    """Target number of corrector iterations for the step control."""
    step: float = 0.01
    """Length of the first step."""
    min_step: float = 1e-8
    """Smallest step length."""
    max_step: float = 0.05
    """Largest step length."""
    angle: float = 0.1
    """Target change of direction per step for the step control (rad)."""
    max_angle: float = 0.35
    """Change of direction above which a step is rejected (rad)."""
    max_points: int = 1000
    """Maximum number of ordinary points on a branch."""
    special: bool = True
    """Whether to locate and report special points."""
    localise: str = "auto"
    """Method of locating special points. `"newton"` solves the extended system, which
    needs second derivatives of the residual; `"bracket"` brackets the special point
    between points of the branch and needs no second derivatives; `"auto"` is
    `"bracket"` if `problem.costly` is set, otherwise `"newton"`.
    """

    def __check_init__(self):
        if not 0 < self.tolerance < 1e-2:
            raise ValueError(
                f"tolerance is {self.tolerance:g}; give a positive number below 1e-2, "
                "such as 1e-10"
            )
        if not 0 < self.min_step <= self.step <= self.max_step:
            raise ValueError(
                f"steps {self.min_step:g}, {self.step:g}, {self.max_step:g} must "
                "satisfy 0 < min_step <= step <= max_step"
            )
        if not 0 < self.angle <= self.max_angle < 1.5:
            raise ValueError(
                f"angles {self.angle:g} and {self.max_angle:g} must satisfy "
                "0 < angle <= max_angle < 1.5 rad"
            )
        if not 1 <= self.iterations <= self.max_iterations:
            raise ValueError("give 1 <= iterations <= max_iterations")
        if self.max_points < 1:
            raise ValueError("max_points must be at least 1")
        if self.localise not in ("auto", "newton", "bracket"):
            raise ValueError(
                f"localise is {self.localise!r}; give 'auto', 'newton' or 'bracket'"
            )


_NOT_OF_A_BATCH = ("max_points", "special", "localise")
"""Settings that a batch ignores: a batch has its own maximum number of points, and its
special points are located when one of its branches is requested.
"""


def as_traced(settings: BranchSettings) -> BranchSettings:
    """Convert settings for a batch, whose compiled program does not check them.

    Numbers become arrays except `max_iterations`, which the corrector needs as a Python
    integer; settings that a batch does not use are reset to their defaults. Therefore
    only a change of `max_iterations` requires another program.
    """
    unused = {name: getattr(BranchSettings, name) for name in _NOT_OF_A_BATCH}
    settings = dataclasses.replace(settings, **unused)
    fixed = (*_NOT_OF_A_BATCH, "max_iterations")
    traced = [f.name for f in dataclasses.fields(settings) if f.name not in fixed]

    def numbers(s: BranchSettings) -> list:
        return [getattr(s, name) for name in traced]

    arrays = [np.asarray(x, float) for x in numbers(settings)]
    return eqx.tree_at(numbers, settings, arrays)
