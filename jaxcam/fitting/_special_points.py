"""Where orbits of impacts appear or lose their stability, and where contact is lost.

Each point is the root of a smooth system of equations in which the parameter is one
more unknown, so that it can be differentiated with respect to all the others.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..hybrid import HybridSystem
from ..hybrid._normal import free_jet
from ._impact_orbit import ImpactOrbit, orbit_monodromy, orbit_residual
from ._implicit import implicit_root


class SpecialPoint(eqx.Module):
    """A value of the parameter at which something happens, and where it happens."""

    #: value of the parameter, in its own unit
    parameter: Float[Array, ""]
    #: the impacts of the orbit, behind its graze if it has one; for a detachment the
    #: time and state of the contact
    orbit: ImpactOrbit


def orbit_where(
    system: HybridSystem,
    where: Callable[[Any], Any],
    guess: ImpactOrbit,
    test: Callable[[Float[Array, "n n"]], Float[Array, ""]],
    *,
    turns: int = 1,
    constraint: int = 0,
    steps: int = 32,
) -> SpecialPoint:
    """The orbit, and the parameter, for which a function of the monodromy is zero.

    **Arguments:** the system with the parameter near the point, `where` that picks the
    parameter, the orbit near it, `test(matrix)` with the matrix of
    [`jaxcam.fitting.orbit_monodromy`][], and the options of
    [`jaxcam.fitting.impact_orbit`][].

    **Returns:** NaN where Newton's method does not converge.
    """
    options = {"turns": turns, "constraint": constraint, "steps": steps}

    def residual(unknowns):
        moved = eqx.tree_at(where, system, unknowns[-1])
        orbit = ImpactOrbit.from_vector(unknowns[:-1], guess.number)
        value = test(orbit_monodromy(moved, orbit, **options))
        return jnp.append(orbit_residual(moved, orbit, **options), value)

    start = jnp.append(guess.to_vector(), jnp.asarray(where(system)))
    root = implicit_root(residual, start)
    return SpecialPoint(root[-1], ImpactOrbit.from_vector(root[:-1], guess.number))


def fold_of_orbit(
    system: HybridSystem, where: Callable[[Any], Any], guess: ImpactOrbit, **options
) -> SpecialPoint:
    """The parameter at which a multiplier of the orbit is +1; see `orbit_where`."""

    def test(matrix):
        return jnp.linalg.det(matrix - jnp.eye(matrix.shape[0]))

    return orbit_where(system, where, guess, test, **options)


def flip_of_orbit(
    system: HybridSystem, where: Callable[[Any], Any], guess: ImpactOrbit, **options
) -> SpecialPoint:
    """The parameter at which a multiplier of the orbit is -1; see `orbit_where`."""

    def test(matrix):
        return jnp.linalg.det(matrix + jnp.eye(matrix.shape[0]))

    return orbit_where(system, where, guess, test, **options)


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

    **Returns:** NaN where Newton's method does not converge.
    """

    def residual(unknowns):
        moved = eqx.tree_at(where, system, unknowns[0])
        return free_jet(moved, unknowns[1], unknowns[2:])[constraint]

    first = jnp.stack([jnp.asarray(where(system)), jnp.asarray(t, dtype=float)])
    root = implicit_root(residual, jnp.concatenate([first, state]))
    return SpecialPoint(root[0], ImpactOrbit(root[1:2], root[None, 2:]))


def release_near(
    system: HybridSystem, t, state: Float[Array, " 2"], *, constraint: int = 0
) -> tuple[Float[Array, ""], Float[Array, " 2"]]:
    """Time (s) and state of the release from contact near `t` and `state`.

    The root of gap, normal velocity and acceleration, differentiable in all parameters.
    [`jaxcam.hybrid.release_point`][] finds a place to start from.
    """

    def residual(unknowns):
        return free_jet(system, unknowns[0], unknowns[1:])[constraint, :3]

    first = jnp.asarray(t, dtype=float)[None]
    root = implicit_root(residual, jnp.concatenate([first, state]))
    return root[0], root[1:]
