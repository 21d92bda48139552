"""Impacts with Coulomb friction at several contacts at the same instant.

With Poisson's coefficient, an impact consists of the three steps described in
`_impacts_together.py`; each of them fulfils Coulomb's law at all contacts, with the
slip velocities at its end. With Newton's coefficient, there is one step: v' + e v takes
the place of v', where v is the approach velocity before the impact, and the friction
opposes the slip after it. (J. J. Moreau, Unilateral contact and dry friction in finite
freedom dynamics, 1988; C. Glocker, F. Pfeiffer, Multiple impacts with friction in rigid
multibody systems, Nonlinear Dynamics 7, 1995)

Compression alone never creates energy. The impulses that restitution adds are reduced
at all contacts, if necessary, until the whole impact does not create energy either;
friction is then within its limits, but need not reach them at a contact that slips. The
energy is known without the masses if the friction of a contact acts against its
switching function.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._types import State
from ._contact_friction import restitution_kind, sides_of, surfaces_of
from ._coulomb_contacts import contact_impulses
from ._impacts import contact_at, FrictionlessLaw
from ._restitution_bound import restitution_bound


def frictional_impacts_together(
    system, t, x, closed: Bool[Array, " m"], law: FrictionlessLaw
) -> State:
    """Return the state after the impact with friction at all closed contacts."""
    rubbing = _rubbing(system, t, x, law.directions)
    columns = jnp.concatenate([rubbing.transfers, law.directions + rubbing.pushes])
    rows = jnp.concatenate([rubbing.gradients, law.slope])
    sent = (
        rows @ columns.T,
        rows @ jnp.concatenate([rubbing.transfers, law.directions]).T,
        jnp.sum(rubbing.gradients * rubbing.pushes, axis=1),
        jnp.concatenate([rubbing.slips, law.velocities]),
        law.coefficients,
        closed,
    )
    newton = restitution_kind(system) in ("kinematic", "complementarity")
    # a scan of length one keeps the arrays, which would otherwise be split into
    # thousands of scalars
    _, found = jax.lax.scan(
        lambda _, __: (None, _impulses(*sent, newton)), None, None, length=1
    )
    return x + found[0] @ columns


def _impulses(matrix, apart, along, velocities, coefficients, closed, newton: bool):
    """Return the impulses of all contacts, defined as in `contact_impulses`.

    **Arguments:**

    - `matrix`, `velocities` and `closed`, as for `contact_impulses`.
    - `apart`: the matrix for impulses of friction and normal impulses, each in its own
        direction; and `along`, the friction during positive slip in units of the
        transfer.
    - `newton`: whether the `coefficients` are Newton's, otherwise Poisson's.
    """
    number = len(closed)
    slips, before = velocities[:number], velocities[number:]
    # slips far below the changes that the impact causes are rounding errors
    pressing = jnp.where(closed, jnp.abs(before), 0.0)
    changes = jnp.abs(matrix[:number, number:]) @ pressing
    slipping = _largest(jnp.maximum(jnp.abs(slips), changes), closed)
    sizes = jnp.repeat(jnp.stack([slipping, _largest(before, closed)]), number)
    pressed = contact_impulses(matrix, velocities, closed, sizes)
    between = velocities + matrix @ pressed
    if newton:
        rebound = coefficients * jnp.minimum(before, 0.0)
        wanted = velocities.at[number:].add(rebound)
        back = contact_impulses(matrix, wanted, closed, sizes) - pressed
    else:
        normal = coefficients * pressed[number:]
        back = contact_impulses(matrix, between, closed, sizes, normal)
    # to compute the energy, impulses of friction and normal impulses are separated
    along = jnp.concatenate([along, jnp.zeros_like(before)])
    down, up = (part + along * jnp.tile(part[number:], 2) for part in (pressed, back))
    bounds = restitution_bound(apart, velocities, down, up, jnp.ones(2 * number))
    back = jnp.min(bounds) * back
    after = between + matrix @ back
    return pressed + back + contact_impulses(matrix, after, closed, sizes)


def _largest(velocities, closed):
    """Return the largest magnitude of the velocities at closed contacts, or one if all
    are zero; the result has no derivatives.
    """
    sizes = jax.lax.stop_gradient(jnp.abs(velocities))
    found = jnp.max(jnp.where(closed, sizes, 0.0))
    return jnp.where(found > 0, found, 1.0)


class _Rubbing(NamedTuple):
    """For each contact: the slip velocity, its derivatives with respect to the state,
    the friction during positive slip, and the change of friction from positive to
    negative slip.

    The slip velocity is scaled so that this change of friction changes it by one; it is
    zero for a contact without friction.
    """

    slips: Float[Array, " m"]
    gradients: Float[Array, "m n"]
    pushes: Float[Array, "m n"]
    transfers: Float[Array, "m n"]


def _rubbing(system, t, x, directions) -> _Rubbing:
    sides = sides_of(system, t, x)
    contacts = [contact_at(system, t, x, k, sides, d) for k, d in enumerate(directions)]
    places = jnp.stack([one.surface for one in contacts])
    pushes = jnp.stack([one.positive for one in contacts])
    transfers = jnp.stack([one.negative for one in contacts]) - pushes
    slips = surfaces_of(system, t, x)[places]
    gradients = jax.jacfwd(lambda y: surfaces_of(system, t, y))(x)[places]
    unit = jnp.sum(gradients * transfers, axis=1)
    rubs = unit > 0
    scale = jnp.where(rubs, 1 / jnp.where(rubs, unit, 1.0), 0.0)
    return _Rubbing(scale * slips, scale[:, None] * gradients, pushes, transfers)
