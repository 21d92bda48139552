"""Impacts at several constraints at the same instant.

The impulses p of all constraints act together, in compression and then in restitution
(Poisson's law). With the normal velocities v and the matrix G of their changes by the
impulses:

- compression ends with v' = v + G p >= 0, p >= 0, one of both zero at each constraint
  (a linear complementarity problem): no gap closes any more;
- restitution adds the impulses e p, with the coefficient e of each constraint;
- if a gap would still close, a last compression prevents it.

No step depends on an order of the constraints. With equal coefficients, restitution
returns e^2 of the energy lost in compression; with different coefficients of
constraints that influence each other, e p might return more than was lost. It is then
reduced to the part that returns the square of the largest coefficient, so that impacts
never create energy. (C. Glocker, F. Pfeiffer, Multiple impacts with friction in rigid
multibody systems, Nonlinear Dynamics 7, 1995)
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._complementary import complementary
from ._contact_friction import has_friction
from ._impacts import frictionless_law
from ._normal import normal_velocity


# more constraints than this hit one after the other: there are 2^m active sets
MOST_TOGETHER = 4
# coefficients of influence below this are rounding
_UNCOUPLED = 1e-12


def may_hit_together(system: HybridSystem, states: int, number: int) -> bool:
    """Return whether impacts may be applied together.

    A body with one direction of motion, that is, up to three states (with a phase),
    cannot approach different constraints.

    **Arguments:** the system, its number of states, and its number of constraints.
    """
    few = 1 < number <= MOST_TOGETHER
    return few and states > 3 and not has_friction(system)


def impacts_together(
    system: HybridSystem, t: RealScalar, x: State, closed: Bool[Array, " m"]
) -> State:
    """Return the state after an impact at all `closed` constraints that approach.

    Args:
        system: A system without contact friction.
        t: Time (s).
        x: State just before the impact, shape `(n,)`.
        closed: Which gaps are closed, in contact or not, shape `(m,)`.

    Returns:
        The state after the impact, shape `(n,)`.
    """
    before = normal_velocity(system, t, x)
    slope = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    directions, coefficients = frictionless_law(system, t, x)
    total = joint_impulses(slope @ directions.T, before, coefficients, closed)
    return x + total @ directions


def joint_impulses(
    matrix: Float[Array, "m m"],
    before: Float[Array, " m"],
    coefficients: Float[Array, " m"],
    closed: Bool[Array, " m"],
) -> Float[Array, " m"]:
    """Return the impulses, each in units of the change of its own normal velocity.

    **Arguments:** the changes of the normal velocities by unit impulses, with a
    diagonal of one; the normal velocities before the impact; the coefficients of
    restitution; and which gaps are closed.
    """
    pressed = complementary(matrix, before, closed)
    back = coefficients * pressed
    back = back * _bound(matrix, pressed, back, coefficients)
    after = before + matrix @ (pressed + back)
    return pressed + back + complementary(matrix, after, closed)


def _bound(matrix, pressed, back, coefficients):
    """Return the factor, up to one, by which the energy limits each restitution."""
    number = pressed.shape[0]
    ratios, coupled = _metric(matrix)
    factors = []
    for i in range(number):
        # energies in a common unit, of the constraints that influence each other
        weights = [jnp.where(coupled[i][a], ratios[i][a], 0.0) for a in range(number)]
        stored, returned = (
            sum(
                weights[a] * part[a] * matrix[a, b] * part[b]
                for a in range(number)
                for b in range(number)
            )
            for part in (pressed, back)
        )
        largest = jnp.zeros_like(pressed[0])
        for a in range(number):
            counts = coupled[i][a] & (pressed[a] > 0)
            largest = jnp.where(counts, jnp.maximum(largest, coefficients[a]), largest)
        most = largest * largest * stored
        exceeds = returned > most
        share = most / jnp.where(exceeds, returned, 1.0)
        positive = exceeds & (share > 0)
        root = jnp.sqrt(jnp.where(positive, share, 1.0))
        factors.append(jnp.where(exceeds & ~positive, 0.0, root))
    return jnp.stack(factors)


def _metric(matrix):
    """Return the ratios of the inverse masses of the constraints, and which influence
    each other, if only through others.

    The matrix is symmetric but for these masses: G_ab / m_a = G_ba / m_b.
    """
    number = matrix.shape[0]
    every = range(number)
    ratios, coupled = [], []
    for i in every:
        row, flags = [], []
        for k in every:
            flag = jnp.abs(matrix[i, k] * matrix[k, i]) > _UNCOUPLED**2
            flag = flag | (i == k)
            row.append(matrix[i, k] / jnp.where(flag, matrix[k, i], 1.0))
            flags.append(flag)
        ratios.append(row)
        coupled.append(flags)
    for through in every:
        for i in every:
            for k in every:
                if through in (i, k) or i == k:
                    continue
                path = coupled[i][through] & coupled[through][k] & ~coupled[i][k]
                longer = ratios[i][through] * ratios[through][k]
                ratios[i][k] = jnp.where(path, longer, ratios[i][k])
                coupled[i][k] = coupled[i][k] | path
    return ratios, coupled
