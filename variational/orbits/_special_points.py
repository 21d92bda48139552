"""Where orbits of impacts appear, lose their stability or graze; where contact is lost.

Each point is the root of a smooth system of equations in which the parameter is one
more unknown, so that it can be differentiated with respect to all the others.
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
    """A value of the parameter at which something happens, and where it happens."""

    parameter: Float[Array, ""]
    """Value of the parameter, in its own unit."""
    orbit: ImpactOrbit
    """The impacts of the orbit, behind its graze if it has one; for a detachment the
    time and state of the contact."""


def _where(
    system: HybridSystem,
    where: Callable[[Any], Any],
    guess: ImpactOrbit,
    test: Callable[[Shooting, Any, HybridSystem], Float[Array, ""]],
) -> SpecialPoint:
    """Orbit and parameter for which `test(equations, unknowns, system)` is zero."""
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
    """The orbit, and the parameter, for which a function of the monodromy is zero.

    **Arguments:** the system with the parameter near the point, `where` that picks the
    parameter, the orbit near it, and `test(matrix)` with the matrix of
    [`variational.orbits.orbit_monodromy`][].

    Returns:
        NaN where Newton's method does not converge.
    """
    return _where(system, where, guess, lambda *orbit: test(monodromy_of(*orbit)))


def fold_of_orbit(
    system: HybridSystem, where: Callable[[Any], Any], guess: ImpactOrbit
) -> SpecialPoint:
    """The parameter at which a multiplier of the orbit is +1; see `orbit_where`."""

    def test(matrix):
        return jnp.linalg.det(matrix - jnp.eye(matrix.shape[0]))

    return orbit_where(system, where, guess, test)


def flip_of_orbit(
    system: HybridSystem, where: Callable[[Any], Any], guess: ImpactOrbit
) -> SpecialPoint:
    """The parameter at which a multiplier of the orbit is -1; see `orbit_where`."""

    def test(matrix):
        return jnp.linalg.det(matrix + jnp.eye(matrix.shape[0]))

    return orbit_where(system, where, guess, test)


def graze_of_orbit(
    system: HybridSystem, where: Callable[[Any], Any], guess: ImpactOrbit
) -> SpecialPoint:
    """The parameter at which a periodic orbit grazes, differentiable in all others.

    A graze is an impact without speed. The square root of a grazing bifurcation is in
    the orbits behind it, not in the graze.

    Args:
        system: Near the graze; `where` picks the parameter.
        guess: The graze first, then the impacts of the orbit in the order in which they
            follow it, up to one period later; the graze alone for an orbit without
            impacts. Its `constraints` say which constraint is touched, and which are
            hit.

    Returns:
        The orbit begins with the graze. NaN where Newton's method does not converge.
            That the gap has a minimum there, not a maximum, and is open elsewhere is
            not looked at; see [`jaxcam.hybrid.surface.normal_acceleration`][].
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
    """The parameter at which sustained contact is lost for the first time.

    There the acceleration that contact suppresses touches zero: gap, normal velocity,
    acceleration and jerk vanish together. (2.30)-(2.32)

    **Arguments:** the system near the detachment, `where` that picks the parameter, and
    time (s) and state near the weakest contact, shape `(2,)`.

    Returns:
        NaN where Newton's method does not converge.
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
    """Time (s) and state of the release from contact near `t` and `state`.

    The root of gap, normal velocity and acceleration, differentiable in all parameters.
    [`jaxcam.hybrid.surface.release_point`][] finds a place to start from.
    """

    def residual(unknowns):
        return free_jet(system, unknowns[0], unknowns[1:])[constraint, :3]

    first = jnp.asarray(t, dtype=float)[None]
    root = implicit_root(residual, jnp.concatenate([first, state]))
    return root[0], root[1:]
