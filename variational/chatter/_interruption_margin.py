"""Evaluate the interruption equation cheaply, for curves in two parameters."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxcam import HybridSystem
from jaxcam.hybrid.surface import normal_acceleration

from .._one_jacobian import with_one_jacobian
from ._chatter_frame import ChatterFrame
from ._impact_map import rebound_speed
from ._impact_search import frozen, longest_step, search_step, SearchState, take_off
from ._lambda_map import koenigs
from ._scalar import one_constraint
from ._scaling_law import scaling_law


_MAX_STEPS = 100_000
# lambda/(1 - r) below which the rest of the sequence is certainly complete
_SMALL = 1e-6
# contribution to the margin below which later impacts are omitted
_ENOUGH = 1e-16
# time to release, relative to the period, below which rounding determines the next
# event
_NEAR = 1e-12


class _Sequence(NamedTuple):
    """The state of the sequence of impacts after those found so far."""

    over: Bool[Array, ""]
    turn: Int[Array, ""]
    """Number of the period, from 1, whose end is the next release."""
    tau: Float[Array, ""]
    """Time of the impact that defines the margin, relative to that release."""
    speed: Float[Array, ""]
    """Rebound speed of that impact."""
    rank: Int[Array, ""]
    """Number of that impact in its period; -1 if there is none."""
    here: Int[Array, ""]
    """Number of impacts in the period so far."""


def interruption_margin(
    system: HybridSystem, frame: ChatterFrame, periods: int = 1
) -> Float[Array, ""]:
    """Return the signed distance from interruption of an orbit that sticks once.

    It is the margin of [`variational.chatter_accumulation`][], with the same accuracy:
    zero if the impacts accumulate at the last release, negative if they accumulate
    earlier. Impacts too close to that release to matter are omitted, and the derivative
    needs only one run along the motion for any number of directions.

    **Arguments:** a system with two states, one constraint and a period, already
    `prepared`; its release; the number of `periods` from this release to the last one.
    The function is pure: it can be compiled, batched, and differentiated once in
    forward mode.

    Returns:
        The margin; NaN if there is no impact in the last period, or if contact occurs
            in an earlier period.

    Raises:
        ValueError: The function is differentiated twice.
    """
    return _margin(system, frame, periods=periods)


@jax.custom_jvp
def _last(slope):
    """Return the slope, which must not be differentiated again, because the derivatives
    of impacts are correct only to first order.
    """
    return slope


@_last.defjvp
def _last_jvp(primals, tangents):
    del primals, tangents
    raise ValueError(
        "interruption_margin can be differentiated only once; for second derivatives, "
        "differentiate variational.chatter_accumulation(...).margin, or use "
        "differences of first derivatives"
    )


@functools.partial(with_one_jacobian, finish=_last)
def _margin(system, frame: ChatterFrame, *, periods: int) -> Float[Array, ""]:
    """Return the margin, from the motion that leaves the release."""
    period = jnp.asarray(system.period, jnp.float64)

    def look(carry):
        flight, said, count = carry
        flight, lands = search_step(system, flight)
        flight, said = jax.lax.cond(
            lands,
            lambda f, s: (
                f := _bounced(system, f),
                _heard(system, frame, periods, s, f),
            ),
            lambda f, s: (f, s),
            flight,
            said,
        )
        return flight, said, count + 1

    def goes_on(carry):
        flight, said, count = carry
        # a motion that just misses the constraint near release may hit it only in the
        # next period
        waits = flight.time - flight.since < 2 * period
        return ~said.over & waits & (count < _MAX_STEPS)

    zero, none = jnp.zeros(()), jnp.asarray(0)
    silence = _Sequence(jnp.asarray(False), none + 1, -period, zero, none - 1, none)
    flight = take_off(system, frame.release, frame.state, zero, longest_step(system))
    start = (flight, silence, none)
    said = jax.lax.while_loop(goes_on, look, start)[1]
    known = said.rank >= 0
    lam = said.speed / (frame.jerk * said.tau * said.tau)
    law = scaling_law(frame.restitution)
    power = jnp.exp(said.rank.astype(jnp.float64) * jnp.log(law.q))
    margin = koenigs(lam, law.lambda_bar, frame.restitution, law.q) * power
    return jnp.where(known, margin, jnp.nan)


def _heard(system, frame, periods: int, s: _Sequence, f: SearchState) -> _Sequence:
    """Return the state of the sequence after the latest impact."""
    period = jnp.asarray(system.period, jnp.float64)
    law = scaling_law(frozen(frame.restitution))
    since, speed = f.time - frame.release, f.y[-2]
    passed = jnp.floor(frozen(since / period)).astype(s.turn.dtype)
    turn = jnp.clip(passed + 1, s.turn, periods)
    tau = since - turn.astype(jnp.float64) * period
    early = tau < -_NEAR * period
    safe = jnp.where(early, tau, -period)
    lam = speed / (frame.jerk * safe * safe)
    push = normal_acceleration(system, f.time, f.y[:-2])[0]
    small = _SMALL * (1 - frame.restitution) * push * push
    settled = early & (push < 0) & (speed * frame.jerk <= small)
    new, last = turn > s.turn, turn == periods
    rank, here = jnp.where(new, -1, s.rank), jnp.where(new, 0, s.here)
    # take the last impact before release whose lambda is not far below lambda_bar
    takes = early & last & ((lam >= law.lambda_bar / 2) | (rank < 0))
    # later impacts change the margin only by terms of order q^k tau_k
    rest = jnp.exp(here.astype(jnp.float64) * jnp.log(law.q)) * jnp.abs(tau)
    return _Sequence(
        over=settled | (last & (~early | (rest <= _ENOUGH * period))),
        turn=turn,
        tau=jnp.where(takes, tau, s.tau),
        speed=jnp.where(takes, speed, s.speed),
        rank=jnp.where(takes, here, rank),
        here=here + 1,
    )


def _bounced(system: HybridSystem, f: SearchState) -> SearchState:
    """Return the start of the flight after an impact, given the motion before it."""
    x, approach = f.y[:-2], f.y[-2]
    after = one_constraint(system.impact(f.time, x), 1)
    speed = rebound_speed(system, f.time, x, approach)
    return take_off(system, f.time, after, speed, f.longest)
