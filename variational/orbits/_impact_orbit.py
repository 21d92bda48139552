"""A periodic orbit given by its impacts, smooth in every parameter of its system.

The number of impacts is given, so no events have to be found: that is what a fit to
published numbers needs.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.surface import normal_velocity

from ._implicit import implicit_root
from ._links import monodromy_of
from ._shooting import Shooting


class ImpactOrbit(eqx.Module):
    """A periodic orbit that flies between impacts, without sustained contact."""

    times: Float[Array, " k"]
    """Shape `(k,)`, the impacts of one period of the orbit (s), increasing."""
    states: Float[Array, "k n"]
    """Shape `(k, n)`, the state just after each of them."""
    constraints: tuple[int, ...] | None = eqx.field(static=True, default=None)
    """Which constraint each impact hits; the first by default."""
    periods: int = eqx.field(static=True, default=1)
    """Of the forcing, after which the orbit repeats."""
    steps: int = eqx.field(static=True, default=32)
    """Runge-Kutta steps of order 8 in each flight."""

    @property
    def number(self) -> int:
        """How many impacts the orbit has."""
        return self.times.shape[0]

    @property
    def shooting(self) -> Shooting:
        """The equations that it solves."""
        hit = (0,) * self.number if self.constraints is None else self.constraints
        return Shooting(hit, self.periods, self.states.shape[1], self.steps)

    def unknowns(self, system: HybridSystem) -> Float[Array, " u"]:
        """The unknowns of these equations."""
        phases = self.times / system.period
        return jnp.concatenate([phases[:, None], self.states], axis=1).ravel()

    def moved(self, unknowns: Float[Array, " u"], system: HybridSystem):
        """The orbit of the same kind with other unknowns."""
        rows = unknowns.reshape(self.number, -1)
        times = rows[:, 0] * system.period
        return eqx.tree_at(lambda o: (o.times, o.states), self, (times, rows[:, 1:]))


def impact_orbit(system: HybridSystem, guess: ImpactOrbit) -> ImpactOrbit:
    """The orbit near `guess`, differentiable with respect to every parameter.

    Returns:
        A [`variational.orbits.ImpactOrbit`][], NaN where there is none near the guess.
            That its flights stay clear of the constraints is not looked at; see
            [`variational.orbits.clearance`][].
    """

    def residual(unknowns):
        return guess.shooting.residual(unknowns, system)

    return guess.moved(implicit_root(residual, guess.unknowns(system)), system)


def orbit_monodromy(system: HybridSystem, orbit: ImpactOrbit) -> Float[Array, "n n"]:
    """How a deviation at a fixed phase grows over one period of the orbit.

    Product of flight transition matrices and saltation matrices, in the order of the
    motion, beginning just after the first impact.

    Returns:
        Shape `(n, n)`. Its eigenvalues are the Floquet multipliers.
    """
    return monodromy_of(orbit.shooting, orbit.unknowns(system), system)


def orbit_trace(system: HybridSystem, orbit: ImpactOrbit) -> Float[Array, ""]:
    """Sum of the Floquet multipliers."""
    return jnp.trace(orbit_monodromy(system, orbit))


def orbit_determinant(system: HybridSystem, orbit: ImpactOrbit) -> Float[Array, ""]:
    """Product of the Floquet multipliers."""
    return jnp.linalg.det(orbit_monodromy(system, orbit))


def clearance(system: HybridSystem, orbit: ImpactOrbit) -> Float[Array, ""]:
    """Minimum admissibility margin: positive for an orbit that is real.

    The least of the approach and rebound speeds of its impacts, the durations of its
    flights, and the lowest gap within each flight.
    """
    shooting, u = orbit.shooting, orbit.unknowns(system)
    seen = shooting.seen(u, system)
    starts, ends = shooting.flights(u, system)
    # the flight of row k begins with impact k
    hits = jnp.roll(shooting.hit(), 1)
    rebound = jax.vmap(lambda s, k: normal_velocity(system, s[0], s[1:])[k])(
        starts, hits
    )
    least = (seen.gaps, seen.speeds, rebound, ends - starts[:, 0])
    return jnp.min(jnp.stack([jnp.min(each) for each in least]))
