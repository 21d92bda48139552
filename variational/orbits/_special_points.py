"""Compute special points of orbits with impacts: fold, flip, grazing and detachment.

Each point is the root of a smooth system of equations in which the parameter is an
additional unknown, so that it can be differentiated with respect to all other
parameters.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.surface import free_jet

from ._impact_orbit import ImpactOrbit
from ._implicit import implicit_root
from ._links import monodromy_of
from ._shooting import Shooting


class SpecialPoint(eqx.Module):
    """A special value of a parameter, and the orbit at this value."""

    parameter: Float[Array, ""]
    """Value of the parameter, in its own unit."""
    orbit: ImpactOrbit
    """The impacts of the orbit, preceded by the grazing point if there is one; for a
    detachment, the time and state at which contact is lost.
    """


def _where(
    system: HybridSystem,
    where: Callable[[Any], Any],
    guess: ImpactOrbit,
    test: Callable[[Shooting, Any, HybridSystem], Float[Array, ""]],
) -> SpecialPoint:
    """Find the orbit and parameter for which `test(equations, unknowns, system)` is
    zero.
    """
    shooting = guess.shooting

    def residual(unknowns):
        moved = eqx.tree_at(where, system, unknowns[-1])
        u = unknowns[:-1]
        return jnp.append(shooting.residual(u, moved), test(shooting, u, moved))

    value = jnp.asarray(where(system))
    root = implicit_root(residual, jnp.append(guess.unknowns(system), value))
    moved = eqx.tree_at(where, system, root[-1])
    return SpecialPoint(root[-1], guess.moved(root[:-1], moved))


def orbit_where(
    system: HybridSystem,
    where: Callable[[Any], Any],
    guess: ImpactOrbit,
    test: Callable[[Float[Array, "n n"]], Float[Array, ""]],
) -> SpecialPoint:
    """Find the parameter value for which a function of the monodromy matrix is zero.

    Args:
        system: The system, with the parameter near the solution.
        where: Selects the parameter.
        guess: An orbit near the solution.
        test: Function of the matrix of [`variational.orbits.orbit_monodromy`][].

    Returns:
        The parameter and the orbit; NaN if Newton's method does not converge.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import orbit_trace, orbit_where
        >>> from variational.orbits import one_impact_orbits
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbit = one_impact_orbits(system, jnp.array([-0.5, 0.0]))[0]
        >>> trace = orbit_trace(system, orbit)
        >>> test = lambda matrix: jnp.trace(matrix) - trace
        >>> point = orbit_where(system, lambda s: s.wall, orbit, test)
        >>> round(float(point.parameter), 6)
        -0.5
    """
    return _where(system, where, guess, lambda *orbit: test(monodromy_of(*orbit)))


def _orbit_with_multiplier(system, where, guess, multiplier: float) -> SpecialPoint:
    """Find the parameter value at which the orbit has this real multiplier."""

    def test(matrix):
        return jnp.linalg.det(matrix - multiplier * jnp.eye(matrix.shape[0]))

    return orbit_where(system, where, guess, test)


def fold_of_orbit(
    system: HybridSystem, where: Callable[[Any], Any], guess: ImpactOrbit
) -> SpecialPoint:
    """Find the parameter value at which a multiplier of the orbit is +1.

    Args:
        system: The system, with the parameter near the fold.
        where: Selects the parameter.
        guess: The orbit near the fold.

    Returns:
        The parameter and the orbit; NaN if Newton's method does not converge.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import fold_of_orbit
        >>> from variational.orbits import one_impact_orbits
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=0.0)
        >>> orbit = one_impact_orbits(system, jnp.array([0.0, 0.0]))[0]
        >>> fold_of_orbit(system, lambda s: s.wall, orbit).orbit.number
        1
    """
    return _orbit_with_multiplier(system, where, guess, 1.0)


def flip_of_orbit(
    system: HybridSystem, where: Callable[[Any], Any], guess: ImpactOrbit
) -> SpecialPoint:
    """Find the parameter value at which a multiplier of the orbit is -1.

    Args:
        system: The system, with the parameter near the flip.
        where: Selects the parameter.
        guess: The orbit near the flip.

    Returns:
        The parameter and the orbit; NaN if Newton's method does not converge.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import flip_of_orbit
        >>> from variational.orbits import one_impact_orbits
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=0.0)
        >>> orbit = one_impact_orbits(system, jnp.array([0.0, 0.0]))[0]
        >>> flip_of_orbit(system, lambda s: s.wall, orbit).orbit.number
        1
    """
    return _orbit_with_multiplier(system, where, guess, -1.0)


def graze_of_orbit(
    system: HybridSystem, where: Callable[[Any], Any], guess: ImpactOrbit
) -> SpecialPoint:
    """Find the parameter value at which a periodic orbit grazes.

    The value is differentiable with respect to all other parameters. Grazing is an
    impact of zero speed; the square-root singularity of a grazing bifurcation belongs
    to the orbits beyond it, not to the grazing orbit. The function does not check that
    the gap has a minimum at the grazing point and is positive elsewhere; see
    [`jaxcam.hybrid.surface.normal_acceleration`][].

    Args:
        system: The system, with the parameter near grazing.
        where: Selects the parameter.
        guess: The grazing point, followed by the impacts of the orbit in order, up to
            one period later; for an orbit without impacts, the grazing point alone.
            `constraints` lists the grazed constraint, followed by those that are hit.

    Returns:
        The parameter and the orbit, which begins with the grazing point; NaN if
            Newton's method does not converge.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import graze_of_orbit
        >>> from variational.orbits import ImpactOrbit
        >>> system = ImpactOscillator(omega=2.0, wall=0.3)
        >>> guess = ImpactOrbit(jnp.array([1.6]), jnp.array([[0.33, 0.0]]))
        >>> point = graze_of_orbit(system, lambda s: s.wall, guess)
        >>> round(float(point.parameter), 6)
        0.333333
    """

    def speed(shooting, u, system):
        return shooting.approach(u, system)[0]

    return _where(system, where, guess, speed)


def detachment(
    system: HybridSystem,
    where: Callable[[Any], Any],
    t,
    state: Float[Array, " 2"],
    *,
    constraint: int = 0,
) -> SpecialPoint:
    """Find the parameter value at which sustained contact is first lost.

    At this value, the acceleration suppressed by contact just reaches zero: gap, normal
    velocity, acceleration and jerk vanish together (thesis, eqs. 2.30-2.32).

    Args:
        system: The system, with the parameter near the detachment.
        where: Selects the parameter.
        t: Time near the detachment (s).
        state: State near the detachment, shape `(2,)`.
        constraint: Index of the constraint.

    Returns:
        The parameter, time and state; NaN if Newton's method does not converge.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import detachment
        >>> system = ImpactOscillator(omega=1.0, wall=-0.9)
        >>> point = detachment(system, lambda s: s.wall, 3.1, jnp.array([-0.9, 0.0]))
        >>> round(float(point.parameter), 6)
        -1.0
    """

    def residual(unknowns):
        moved = eqx.tree_at(where, system, unknowns[0])
        return free_jet(moved, unknowns[1], unknowns[2:])[constraint]

    first = jnp.stack([jnp.asarray(where(system)), jnp.asarray(t, dtype=float)])
    root = implicit_root(residual, jnp.concatenate([first, state]))
    return SpecialPoint(root[0], ImpactOrbit(root[1:2], root[None, 2:], (constraint,)))


def release_near(
    system: HybridSystem, t, state: Float[Array, " 2"], *, constraint: int = 0
) -> tuple[Float[Array, ""], Float[Array, " 2"]]:
    """Return the time and state of the release from contact near `t` and `state`.

    At release, gap, normal velocity and acceleration are zero. The result is
    differentiable with respect to all parameters.
    [`jaxcam.hybrid.surface.release_point`][] provides an initial guess.

    Args:
        system: The system.
        t: Time near the release (s).
        state: State near the release, shape `(2,)`.
        constraint: Index of the constraint.

    Returns:
        Time (s) and state at release, shape `(2,)`.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import release_near
        >>> system = ImpactOscillator(omega=1.0, wall=0.5)
        >>> time, _ = release_near(system, 1.0, jnp.array([0.5, 0.0]))
        >>> round(float(time), 6)
        1.047198
    """

    def residual(unknowns):
        return free_jet(system, unknowns[0], unknowns[1:])[constraint, :3]

    first = jnp.asarray(t, dtype=float)[None]
    root = implicit_root(residual, jnp.concatenate([first, state]))
    return root[0], root[1:]
