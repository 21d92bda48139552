"""Simulate the motion on a cam whose motion program has joints, which are events."""

from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..hybrid import simulate, Trajectory
from ..hybrid.checks import refuse_tracers
from ..hybrid.record import Contacts, Impacts, Steps
from ._cam_follower import CamFollower
from ._desmodromic import DesmodromicCam
from ._parameters import parameter
from ._valve_train import ValveTrain
from .cams import CamProfile, MotionPieces, MotionProgram


_TURN = 2 * np.pi
_NEAR = 4e-12
"""Tolerance of gap and velocity in contact, relative to the size of the state."""
_BEHIND = 2e-4
"""Depth below the surface at which a body that moves into the surface is placed, in
units of the tolerance of the gap.
"""
_Part = TypeVar("_Part", Impacts, Contacts, Steps)


class OnePiece(CamProfile):
    """One piece of a motion program, continued smoothly beyond its ends."""

    pieces: MotionPieces
    middle: jax.Array = parameter()

    def __call__(self, cam_angle) -> jax.Array:
        shifted = jnp.mod(cam_angle - self.middle + np.pi, _TURN) - np.pi
        u = (shifted + self.middle - self.pieces.origins[0]) / self.pieces.widths[0]
        coefficients = self.pieces.coefficients[0]
        value = coefficients[-1]
        for k in reversed(range(coefficients.shape[0] - 1)):
            value = coefficients[k] + u * value
        wave = jnp.sin(self.pieces.frequencies[0] * u + self.pieces.phases[0])
        return value + self.pieces.amplitudes[0] * wave


def simulate_through_joints(
    system: CamFollower | ValveTrain | DesmodromicCam, state, t0, t1, **options: Any
) -> Trajectory:
    """Simulate a cam given by a motion program, with exact treatment of its joints.

    The run stops at every joint and continues with the next piece, so that each part is
    smooth. At a joint where the slope of the lift jumps up, a follower in contact has
    an impact; where it jumps down, the follower leaves the cam. The times of the joints
    do not depend on the state, so a joint leaves a perturbation unchanged, and only
    impacts have saltation matrices.

    Args:
        system: A system whose `profile` is a [`jaxcam.models.MotionProgram`][].
        state: Initial state, shape `(n,)`.
        t0: Start time (s).
        t1: End time (s).
        options: As for [`jaxcam.simulate`][jaxcam.hybrid.simulate].

    Returns:
        One trajectory, in which a contact that lasts through a joint is listed once.

    Raises:
        ValueError: The profile is not a motion program; see also `simulate`.

    Examples:
        >>> from jaxcam.models import DesmodromicCam, MotionProgram, Segment
        >>> from jaxcam.models import simulate_through_joints
        >>> rises = (0.01, -0.01)
        >>> program = MotionProgram([Segment("cycloidal", np.pi, r) for r in rises])
        >>> cam = DesmodromicCam(program, speed=10.0, clearance=1e-4)
        >>> run = simulate_through_joints(cam, [5e-5, 0.0], 0.0, 0.1)
        >>> bool(run.successful)
        True
    """
    refuse_tracers("simulate_through_joints", "jaxcam.simulate", system, state, t0, t1)
    program = system.profile
    if not isinstance(program, MotionProgram):
        raise ValueError(
            "Give the system a MotionProgram as its `profile`; for other profiles, "
            "which are smooth, use `jaxcam.simulate`."
        )
    system.check()
    pieces = program.prepared()
    t0, t1 = float(t0), float(t1)
    times = _joint_times(system, np.asarray(pieces.starts), t0, t1)
    legs = []
    for start, end in zip(times[:-1], times[1:], strict=True):
        angle = system.cam_angle(jnp.asarray((start + end) / 2))
        leg = eqx.tree_at(lambda s: s.profile, system, _piece(pieces, angle))
        state = _settled(leg, start, jnp.asarray(state, dtype=float))
        legs.append(simulate(leg, state, start, end, **options))
        if not bool(legs[-1].successful):
            break
        state = legs[-1].final
    return Trajectory(
        system,
        legs[0].settings,
        legs[0].t0,
        jnp.asarray(t1),
        _joined([leg.impacts for leg in legs]),
        _merged(_joined([leg.contacts for leg in legs])),
        _joined([leg.steps for leg in legs]),
        legs[-1].code,
    )


def _joint_times(system, angles, t0, t1):
    """Return t0, the times of the joints between t0 and t1, and t1."""
    first = float(system.cam_angle(0.0))
    rate = float(system.cam_angle(1.0)) - first
    turned = first + rate * np.array([t0, t1])
    turns = np.arange(np.floor(turned.min() / _TURN) - 1, turned.max() / _TURN + 1)
    times = (angles + _TURN * turns[:, None] - first).ravel() / rate
    room = 1e-12 * (1 + max(abs(t0), abs(t1)))
    inside = np.sort(times[(times > t0 + room) & (times < t1 - room)])
    return [t0, *map(float, inside), t1]


def _piece(pieces: MotionPieces, angle) -> OnePiece:
    k = int(pieces.local(angle)[0])
    one = jax.tree.map(lambda leaf: leaf[k : k + 1], pieces)
    middle = (pieces.starts[k] + pieces.ends()[k]) / 2
    return OnePiece(one, middle)


def _settled(system, t, state):
    """Remove rounding errors of gap and velocity from a state in contact.

    If the surface of the next piece moves into the follower, the next run begins with
    an impact, which requires a gap that is not positive.
    """
    t = jnp.asarray(t, dtype=float)
    near = _NEAR * (1.0 + jnp.max(jnp.abs(state)))
    angle, turned = system.cam_angle(t), system.cam_angle(t + 1) - system.cam_angle(t)
    lift, slope = jax.jvp(system.profile, (angle,), (turned,))
    sides = [(lift, 1.0)]
    if isinstance(system, DesmodromicCam):
        sides.append((lift + system.clearance, -1.0))
    for surface, outside in sides:
        velocity = outside * (state[1] - slope)
        if abs(float(state[0] - surface)) > near:
            continue
        if abs(float(velocity)) <= near:
            return jnp.stack([surface, slope])
        if float(velocity) < 0:
            return jnp.stack([surface - outside * near * _BEHIND, state[1]])
    return state


def _joined(parts: list[_Part]) -> _Part:
    """Concatenate the parts of several runs."""
    total = sum(int(part.count) for part in parts)
    leaves = [
        np.concatenate(found) if np.ndim(found[0]) else total
        for found in zip(*(jax.tree.leaves(part) for part in parts), strict=True)
    ]
    return jax.tree.unflatten(jax.tree.structure(parts[0]), map(jnp.asarray, leaves))


def _merged(contacts: Contacts) -> Contacts:
    """Merge contacts that end where the next begins, on the same constraint."""
    keep, ends, released = [], [], []
    start, end = np.asarray(contacts.start), np.asarray(contacts.end)
    which = np.asarray(contacts.constraint)
    for k in range(len(start)):
        goes_on = [
            i for i in range(len(keep)) if ends[i] == start[k] and not released[i]
        ]
        goes_on = [i for i in goes_on if which[keep[i]] == which[k]]
        if goes_on:
            ends[goes_on[0]] = end[k]
            released[goes_on[0]] = bool(contacts.released[k])
        else:
            keep.append(k)
            ends.append(end[k])
            released.append(bool(contacts.released[k]))
    return Contacts(
        jnp.asarray(start[keep]),
        jnp.asarray(ends, dtype=float),
        jnp.asarray(released, dtype=bool),
        jnp.asarray(which[keep]),
        jnp.asarray(len(keep), dtype=contacts.count.dtype),
    )
