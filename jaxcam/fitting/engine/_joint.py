"""Mismatch at a joint, the condition that connects a piece with the one before it."""

from typing import Any

import jax.numpy as jnp

from ._extras import Sharpness
from ._late_switch import follower
from ._model import Model
from ._pieces import FLIGHT, IMPACT, Pieces
from ._predict import flight_joint, impact_joint


def joint_inputs(pieces: Pieces, sharpness: Sharpness, last):
    """Return the arguments of `joint` after the states.

    **Arguments:** `last` is the discrete state at the end of each piece, or `None`.
    """
    discrete = None if last is None else previous(last), pieces.begins
    given = pieces.flown.start, pieces.drive_at, pieces.joint
    return *given, sharpness.piece, discrete


def joint(model: Model, reach, before, state, t, drive, kind, error, discrete):
    """Return the mismatches in state and gap at a joint of any kind, `(n + 1,)`; for a
    switch between two pieces, the gap is the distance from its surface.

    **Arguments:** the `error` of the state of a typical piece; the `discrete` states at
    the end of the previous piece and at the beginning of this one, or `None` twice.
    """
    system = model.driven(t, drive)
    last, first = discrete
    found = follower(model, system, t, before, last, first, reach, error)
    inner = jnp.concatenate([*_flat(flight_joint(found.state, state))])
    inner = inner.at[-1].set(found.missing)
    # without an impact, the search for one must not affect the derivatives
    hit = kind == IMPACT
    found = impact_joint(model, before, state, t, drive, reach, discrete)
    outer = jnp.concatenate([*_flat(found)])
    return jnp.where(hit, outer, jnp.where(kind == FLIGHT, inner, 0.0))


def _flat(joint):
    return joint.state, joint.gap[None]


def strength(sharpness: Sharpness, kind):
    """Return the inverse of the error of each component of a joint; zero if there is no
    joint.
    """
    error = jnp.concatenate([sharpness.impact, sharpness.gap[..., None]], axis=-1)
    # the distance from a switching surface is in standard errors
    flight = jnp.concatenate(
        [sharpness.flight, jnp.ones_like(sharpness.gap[..., None])], axis=-1
    )
    kind = kind[..., None]
    return jnp.where(
        kind == IMPACT, 1 / error, jnp.where(kind == FLIGHT, 1 / flight, 0.0)
    )


def tied(off, sharpness, kind) -> Any:
    return off * strength(sharpness, kind)


def previous(array):
    """Return, for each piece, the row of the piece before it."""
    return jnp.concatenate([array[:1], array[:-1]])
