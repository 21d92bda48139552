"""Impacts at several constraints at the same instant.

The impulses of all constraints act together, in compression and then in restitution
(Poisson's law). Without friction, with the normal velocities v and the matrix G of
their changes by the impulses p:

- compression ends with v' = v + G p >= 0 and p >= 0, one of the two being zero at each
  constraint (a linear complementarity problem): no gap closes any more;
- restitution adds the impulses e p, with the coefficient e of each constraint;
- if a gap would still close, a last compression prevents it.

No step depends on the order of the constraints. With equal coefficients, restitution
returns e^2 of the energy lost in compression; with different coefficients of
constraints that influence each other, e p might return more than was lost. It is then
reduced to the part that returns the lost energy times the square of the largest
coefficient, so that impacts never create energy. (C. Glocker, F. Pfeiffer, Multiple
impacts with friction in rigid multibody systems, Nonlinear Dynamics 7, 1995)

`_frictional_impacts_together.py` is for contacts with friction.
"""

from jaxtyping import Array, Bool, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._complementary import complementary
from ._contact_friction import has_friction
from ._frictional_impacts_together import frictional_impacts_together
from ._impacts import frictionless_law
from ._restitution_bound import restitution_bound


# largest number of constraints of a system with simultaneous impacts: there are 2^m
# active sets, or 4^m with friction; with more constraints, impacts occur one by one
MOST_TOGETHER = 4
MOST_WITH_FRICTION = 3


ONE_DIRECTION = 3
"""Largest number of states (with a phase) of a body with one direction of motion, which
cannot touch several constraints at once."""


def may_hit_together(system: HybridSystem, states: int, number: int) -> bool:
    """Return whether impacts may be applied together.

    **Arguments:** the system, its number of states, and its number of constraints.
    """
    most = MOST_WITH_FRICTION if has_friction(system) else MOST_TOGETHER
    return 1 < number <= most and states > ONE_DIRECTION


def impacts_together(
    system: HybridSystem, t: RealScalar, x: State, closed: Bool[Array, " m"]
) -> State:
    """Return the state after an impact at all `closed` constraints that are approached.

    Args:
        system: The system.
        t: Time (s).
        x: State just before the impact, shape `(n,)`.
        closed: Which gaps are closed, in contact or not, shape `(m,)`.

    Returns:
        The state after the impact, shape `(n,)`.
    """
    law = frictionless_law(system, t, x)
    if has_friction(system):
        return frictional_impacts_together(system, t, x, closed, law)
    matrix = law.slope @ law.directions.T
    total = joint_impulses(matrix, law.velocities, law.coefficients, closed)
    return x + total @ law.directions


def joint_impulses(
    matrix: Float[Array, "m m"],
    before: Float[Array, " m"],
    coefficients: Float[Array, " m"],
    closed: Bool[Array, " m"],
) -> Float[Array, " m"]:
    """Return the impulses without friction, each in units of the change of its own
    normal velocity.

    **Arguments:** the changes of the normal velocities by unit impulses, with a
    diagonal of one; the normal velocities before the impact; the coefficients of
    restitution; and which gaps are closed.
    """
    pressed = complementary(matrix, before, closed)
    back = coefficients * pressed
    back = back * restitution_bound(matrix, before, pressed, back, coefficients)
    after = before + matrix @ (pressed + back)
    return pressed + back + complementary(matrix, after, closed)
