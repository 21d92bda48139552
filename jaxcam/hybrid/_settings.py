"""How accurately a trajectory is made."""

import diffrax
import equinox as eqx


class Settings(eqx.Module):
    """Numbers that decide the accuracy of a run, not its physics.

    **Arguments:**

    - `tolerance`: relative and absolute error allowed in a step, in units of the state.
    - `chatter_smallness`: chatter is completed analytically only where
      lambda/(1 - r) is below this, lambda = v |j| / a^2; the completed time is then
      wrong by about its square, relatively.
    - `chatter_depth`: and only after the speed has fallen to this fraction of the
      fastest rebound since the last release (or hops have become lower than rounding
      can tell). 1 completes as soon as theory allows
      (fast, for sweeps); small values list more impacts of each sequence.
    - `solver`: any explicit Runge-Kutta solver of diffrax with an error estimate.
    """

    tolerance: float = 1e-10
    chatter_smallness: float = 1e-3
    chatter_depth: float = 1e-6
    solver: diffrax.AbstractSolver = eqx.field(
        default_factory=diffrax.Dopri8, static=True
    )

    def check(self) -> None:
        """Raise `ValueError` for a setting outside its range."""
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
