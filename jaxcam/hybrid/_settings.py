"""How accurately a trajectory is made."""

from typing import Literal

import diffrax
import equinox as eqx
import numpy as np
from jaxtyping import ArrayLike, Float

from ..parameters import FloatScalar


class Settings(eqx.Module):
    """Numbers that decide the accuracy of a run, not its physics.

    **Arguments:**

    - `tolerance`: error allowed in a step, in each component relative to how far it has
      moved since the start of the run; at first, to the distance from the constraint
      where a gap depends on the component, and to its own size where none does. So no
      choice of units, nor of the origin of a coordinate, changes the accuracy; but a
      coordinate is never known better than 1e-15 of itself, which limits what can be
      told of a small gap far from the origin.
    - `absolute`: absolute error allowed instead, in units of the state: a number, or
      one for each component, shape `(n,)`. The error allowed is then
      `absolute + tolerance * |state|`.
    - `max_step`: longest step (s). What is narrower than a step, and not seen at its
      stages, is stepped over: state it where forces or barriers are brief, or declare
      them as [`jaxcam.hybrid.HybridSystem.breakpoints`][]. Steps are a quarter of the
      system's period at most; with neither, they are a 64th of the run at most where
      the estimate of their error says nothing (at rest, or in a uniform field).
    - `chatter_smallness`: chatter is completed analytically only where
      lambda/(1 - r) is below this, lambda = v |j| / a^2; the completed time is then
      wrong by about its square, relatively.
    - `chatter_depth`: and only after the speed has fallen to this fraction of the
      fastest rebound since the last release (or hops have become lower than rounding
      can tell). 1 completes as soon as theory allows
      (fast, for sweeps); small values list more impacts of each sequence.
    - `plain`: run the loop as written, without the passes of `jaxcam.hybrid.lowering`
      that make it fast. Slower by an order of magnitude, equal to the tolerance, and
      without reverse mode: a check on these passes, and a way on where one fails.
    - `solver`: any explicit Runge-Kutta solver of diffrax with an error estimate.
    - `backend`: what compiles runs that are not traced: "xla" by default, which all
      traced runs and derivatives go through; "llvm", which is faster and refuses a
      system that needs an operation it has not; or "auto", LLVM where it can and XLA
      where it cannot. Results differ by rounding.
    """

    tolerance: FloatScalar = 1e-10
    chatter_smallness: FloatScalar = 1e-3
    chatter_depth: FloatScalar = 1e-6
    solver: diffrax.AbstractSolver = eqx.field(
        default_factory=diffrax.Dopri8, static=True
    )
    absolute: FloatScalar | Float[ArrayLike, " n"] | None = None
    max_step: FloatScalar | None = None
    plain: bool = eqx.field(default=False, static=True)
    backend: Literal["auto", "llvm", "xla"] = eqx.field(default="xla", static=True)

    @property
    def compiles(self) -> bool:
        """Whether a run that is not traced is to be compiled by LLVM."""
        return self.backend != "xla" and not self.plain

    def check(self) -> None:
        """Raise `ValueError` for a setting outside its range."""
        if self.backend not in ("auto", "llvm", "xla"):
            raise ValueError(
                f'backend is {self.backend!r}; choose "auto", "llvm" or "xla"'
            )
        if not 0 < float(self.tolerance) < 1:
            raise ValueError(
                f"tolerance is {float(self.tolerance):g}; give a number between 1e-14 "
                "and 1e-2, such as 1e-10"
            )
        if not 0 < float(self.chatter_smallness) <= 0.1:
            raise ValueError(
                f"chatter_smallness is {float(self.chatter_smallness):g}; the map for "
                "completing chatter needs a value in (0, 0.1], such as 1e-3"
            )
        if not 0 < float(self.chatter_depth) <= 1:
            raise ValueError(
                f"chatter_depth is {float(self.chatter_depth):g}; give a value in "
                "(0, 1]"
            )
        if self.absolute is not None and not np.all(
            np.isfinite(self.absolute) & (np.asarray(self.absolute) > 0)
        ):
            raise ValueError(
                f"absolute is {self.absolute}; give positive numbers in units of the "
                "state, or leave it out"
            )
        if self.max_step is not None and not float(np.asarray(self.max_step)) > 0:
            raise ValueError(
                f"max_step is {float(np.asarray(self.max_step)):g}; give a positive "
                "length in seconds"
            )
