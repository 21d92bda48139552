"""Periodic orbits represented by their impacts, as smooth functions of all parameters.

The number of impacts is given, so no events have to be detected. Fits to published
numbers use these orbits, because such fits need derivatives with respect to all
parameters.
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
    """A periodic orbit with impacts but without sustained contact."""

    times: Float[Array, " k"]
    """Times of the impacts in one period of the orbit (s), increasing, shape `(k,)`."""
    states: Float[Array, "k n"]
    """State just after each impact, shape `(k, n)`."""
    constraints: tuple[int, ...] | None = eqx.field(static=True, default=None)
    """Constraint hit at each impact; default: the first constraint at every impact."""
    periods: int = eqx.field(static=True, default=1)
    """Number of forcing periods after which the orbit repeats."""
    steps: int = eqx.field(static=True, default=32)
    """Number of eighth-order Runge-Kutta steps in each flight."""

    @property
    def number(self) -> int:
        """Number of impacts."""
        return self.times.shape[0]

    @property
    def shooting(self) -> Shooting:
        """The equations of the orbit."""
        hit = (0,) * self.number if self.constraints is None else self.constraints
        return Shooting(hit, self.periods, self.states.shape[1], self.steps)

    def unknowns(self, system: HybridSystem) -> Float[Array, " u"]:
        """Return the unknowns of the shooting equations.

        Args:
            system: The system.

        Returns:
            Unknowns, shape `(u,)`.
        """
        phases = self.times / system.period
        return jnp.concatenate([phases[:, None], self.states], axis=1).ravel()

    def moved(self, unknowns: Float[Array, " u"], system: HybridSystem):
        """Return an orbit with the same sequence of impacts but other unknowns.

        Args:
            unknowns: Unknowns of the equations, shape `(u,)`.
            system: The system.

        Returns:
            An `ImpactOrbit`.
        """
        rows = unknowns.reshape(self.number, -1)
        times = rows[:, 0] * system.period
        return eqx.tree_at(lambda o: (o.times, o.states), self, (times, rows[:, 1:]))


def impact_orbit(system: HybridSystem, guess: ImpactOrbit) -> ImpactOrbit:
    """Return the periodic orbit near `guess`, differentiable in every parameter.

    Penetration of the constraints is not checked; see
    [`variational.orbits.clearance`][].

    Args:
        system: The system.
        guess: An orbit near the desired one.

    Returns:
        A [`variational.orbits.ImpactOrbit`][]; NaN if there is none near the guess.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import impact_orbit
        >>> from variational.orbits import one_impact_orbits
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> found = one_impact_orbits(system, jnp.array([-0.5, 0.0]))
        >>> impact_orbit(ImpactOscillator(2.8, 0.8, -0.49), found[0]).times.shape
        (1,)
    """

    def residual(unknowns):
        return guess.shooting.residual(unknowns, system)

    return guess.moved(implicit_root(residual, guess.unknowns(system)), system)


def orbit_monodromy(system: HybridSystem, orbit: ImpactOrbit) -> Float[Array, "n n"]:
    """Return the monodromy matrix of an orbit, starting just after the first impact.

    It is the product of the transition matrices of the flights and the saltation
    matrices, in the order of the motion.

    Args:
        system: The system.
        orbit: The periodic orbit.

    Returns:
        The matrix, shape `(n, n)`. Its eigenvalues are the Floquet multipliers.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational.orbits import one_impact_orbits, orbit_monodromy
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbit = one_impact_orbits(system, jnp.array([-0.5, 0.0]))[0]
        >>> matrix = orbit_monodromy(system, orbit)
        >>> np.asarray(matrix).round(4).tolist()
        [[0.4988, -0.6255], [0.9567, 0.0834]]
        >>> round(float(jnp.linalg.det(matrix)), 6)  # restitution squared
        0.64
    """
    return monodromy_of(orbit.shooting, orbit.unknowns(system), system)


def orbit_trace(system: HybridSystem, orbit: ImpactOrbit) -> Float[Array, ""]:
    """Return the sum of the Floquet multipliers of an orbit.

    Args:
        system: The system.
        orbit: The periodic orbit.

    Returns:
        A scalar.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import orbit_trace
        >>> from variational.orbits import one_impact_orbits
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> found = one_impact_orbits(system, jnp.array([-0.5, 0.0]))
        >>> orbit_trace(system, found[0]).shape
        ()
    """
    return jnp.trace(orbit_monodromy(system, orbit))


def orbit_determinant(system: HybridSystem, orbit: ImpactOrbit) -> Float[Array, ""]:
    """Return the product of the Floquet multipliers of an orbit.

    Args:
        system: The system.
        orbit: The periodic orbit.

    Returns:
        A scalar.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import orbit_determinant
        >>> from variational.orbits import one_impact_orbits
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> found = one_impact_orbits(system, jnp.array([-0.5, 0.0]))
        >>> round(float(orbit_determinant(system, found[0])), 6)
        0.64
    """
    return jnp.linalg.det(orbit_monodromy(system, orbit))


def clearance(system: HybridSystem, orbit: ImpactOrbit) -> Float[Array, ""]:
    """Return the minimum admissibility margin, which is positive for a physical orbit.

    It is the smallest of the approach and rebound speeds of the impacts, the durations
    of the flights, and the lowest gaps within the flights.

    Args:
        system: The system.
        orbit: The periodic orbit.

    Returns:
        A scalar.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational.orbits import clearance, ImpactOrbit
        >>> ball = BouncingBall(restitution=1.0, frequency=4 * jnp.pi)
        >>> up = ImpactOrbit(jnp.zeros(1), jnp.array([[0.0, 9.81 / 4]]))
        >>> round(float(clearance(ball, up)), 6)  # height v^2 / (2 g)
        0.306562
        >>> down = ImpactOrbit(jnp.zeros(1), jnp.array([[0.0, -1.0]]))
        >>> float(clearance(ball, down)) < 0
        True
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
