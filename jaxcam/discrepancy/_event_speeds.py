"""Compute the speeds at which the motion of a cam-follower changes.

These are the speeds of detachment (valve float), of the fold and the flip of the orbit
with one impact per cycle, and of the interruption of complete chatter.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from variational import chatter_interruption, detachment, orbit_where
from variational.orbits import (
    ImpactOrbit,
    one_impact_orbits,
    orbit_monodromy,
    SpecialPoint,
)

from ..hybrid.programs import program
from ..models import float_speed
from .policy import Policy
from .terms import WithTerms


EVENTS = (
    "valve float",
    "P(1,1) appears (fold)",
    "P(1,1) doubles its period (flip)",
    "chatter is interrupted",
)
"""Names of the events, in the order of the speeds."""


@dataclasses.dataclass(frozen=True)
class EventSpeeds:
    """The four speeds (rad/s) of one system, and the solutions from which those of
    similar systems are found.

    `values`: shape `(4,)`, in the order of `EVENTS`; NaN for a speed that was not
    found.
    """

    values: np.ndarray
    lift: SpecialPoint | None
    fold: SpecialPoint | None
    flip: SpecialPoint | None
    policy: Policy = Policy()

    def near(self, system: WithTerms) -> "EventSpeeds":
        """Return the speeds of a slightly different system."""
        values, found = np.full(4, np.nan), []
        if self.lift is not None:
            orbit = self.lift.orbit
            moved = _at(system, self.lift.parameter)
            found.append(_lifted(moved, orbit.times[0], orbit.states[0]))
        else:
            found.append(None)
        for point, sign in ((self.fold, 1.0), (self.flip, -1.0)):
            if point is None:
                found.append(None)
                continue
            moved = _at(system, point.parameter)
            found.append(_on_line(moved, point.orbit, sign, sign))
        for k, point in enumerate(found):
            if point is not None:
                values[k] = float(point.parameter)
        if np.isfinite(values[0]):
            values[3] = _interruption(system, values[0], self.policy)
        kept = [
            p if p is not None and np.isfinite(p.parameter) else None for p in found
        ]
        return EventSpeeds(values, *kept, policy=self.policy)


def event_speeds(system: WithTerms, policy: Policy = Policy()) -> EventSpeeds:
    """Find the four speeds of a rig; the drive speed set in it has no effect.

    The base is a [`jaxcam.models.CamFollower`][]; terms may depend on time only through
    the phase of the cam. The policy gives the range in which orbits are searched for.
    """
    lift = _float_of(system)
    if lift is None:
        return EventSpeeds(np.full(4, np.nan), None, None, None, policy)
    speed = float(lift.parameter)
    fold = flip = None
    for share in policy.orbit_speeds:
        orbits = one_impact_orbits(_at(system, share * speed), lift.orbit.states[0])
        if orbits:
            start = SpecialPoint(jnp.asarray(share * speed), orbits[0])
            fold, flip = (
                _towards(system, start, sign, policy.trace_stride)
                for sign in (1.0, -1.0)
            )
            break
    return EventSpeeds(np.full(4, np.nan), lift, fold, flip, policy).near(system)


def _speed(system):
    return system.base.speed


def _at(system, speed):
    return eqx.tree_at(_speed, system, jnp.asarray(speed, dtype=float))


def _float_of(system: WithTerms) -> SpecialPoint | None:
    """Find the detachment (valve float), starting from that of the base alone."""
    base = float_speed(system.base)  # pyright: ignore
    if not (np.isfinite(base.speed) and base.speed > 0):
        return None
    moved = _at(system, base.speed)
    rig = moved.base
    sense = -1.0 if rig.rotation == "clockwise" else 1.0
    t = (sense * base.cam_angle - rig.phase) / base.speed
    angle = rig.contact_angle(rig.cam_angle(t))
    found = _lifted(moved, t, jnp.stack([angle, jnp.zeros_like(angle)]))
    return found if found.parameter > 0 else None


def _towards(
    system, start: SpecialPoint, sign: float, stride: float
) -> SpecialPoint | None:
    """Find the fold (+1) or the flip (-1) of the branch through an orbit.

    The sum of the multipliers is monotonic along the branch, even around the fold,
    where the speed is not. At the fold and the flip, this sum is +-(1 + the product of
    the multipliers).
    """
    moved = _at(system, start.parameter)
    matrix = np.asarray(_monodromy(moved, start.orbit))
    trace, goal = float(np.trace(matrix)), sign * (1 + float(np.linalg.det(matrix)))
    point = start
    for value in np.linspace(trace, goal, 2 + int(abs(goal - trace) / stride))[1:]:
        moved = _at(system, point.parameter)
        point = _on_line(moved, point.orbit, float(value), 0.0)
    point = _on_line(_at(system, point.parameter), point.orbit, sign, sign)
    return point if np.isfinite(point.parameter) else None


def _interruption(system, lifted: float, policy: Policy) -> float:
    low, high = policy.chatter_speeds
    bracket = low * lifted, high * lifted
    try:
        return float(chatter_interruption(system, _speed, bracket))
    except ValueError:
        return float("nan")


@program
def _lifted(system, t, state) -> SpecialPoint:
    return detachment(system, _speed, t, state)


@program
def _monodromy(system, orbit: ImpactOrbit) -> Float[Array, "2 2"]:
    return orbit_monodromy(system, orbit)


def _on_line(system, orbit: ImpactOrbit, offset: float, slope: float) -> SpecialPoint:
    """Find the orbit whose multipliers sum to `offset + slope` times their product."""
    return _compiled(system, orbit, jnp.asarray(offset), jnp.asarray(slope))


@program
def _compiled(system, orbit, offset, slope) -> SpecialPoint:
    def test(matrix):
        return jnp.trace(matrix) - offset - slope * jnp.linalg.det(matrix)

    return orbit_where(system, _speed, orbit, test)
