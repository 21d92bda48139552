"""Follow the motion from the release point, impact by impact, to its accumulation."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxcam import HybridSystem
from jaxcam.hybrid.lowering import while_loop
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import (
    chatter_completion,
    normal_acceleration,
    normal_directions,
    normal_velocity,
)
from jaxcam.parameters import as_arrays

from ._chatter_frame import ChatterFrame, prepared_frame
from ._impact_map import next_impact
from ._lambda_map import koenigs
from ._scalar import check_chatter_system
from ._scaling_law import scaling_law


# maximum number of impacts in the search
_IMPACTS = 2000
# lambda/(1 - r) below which the second-order completion is accurate to 1e-12
_SMALL = 1e-6
# time to release, relative to the period, below which rounding determines the next
# event
_NEAR = 1e-12


class ChatterOrbit(eqx.Module):
    """The motion from release to contact, and the accumulation of its chatter."""

    frame: ChatterFrame
    """The release from which the motion starts; successive releases are one period
    apart.
    """
    accumulation: Float[Array, ""]
    """Time at which the impacts accumulate (s); NaN if they do not accumulate before
    the last release.
    """
    complete: Bool[Array, ""]
    """Whether the impacts accumulate in the last of the given periods, and not earlier.
    """
    margin: Float[Array, ""]
    """Signed distance from the interruption in the last period. It is zero if
    accumulation and release coincide, negative if chatter is complete, and smooth in
    the parameters except where an earlier impact grazes. It is NaN for a period without
    impacts, or if contact occurs in an earlier period.
    """
    impacts: Int[Array, ""]
    """Number of impacts: for a complete sequence, those before the analytical
    completion; for an interrupted sequence, all of them.
    """


class _Search(NamedTuple):
    """The last impact, and the impact that defines the margin."""

    time: Float[Array, ""]
    state: Float[Array, " n"]
    speed: Float[Array, ""]
    found: Bool[Array, ""]
    # whether the remaining sequence is complete, to within rounding
    settled: Bool[Array, ""]
    # number of the period, from 1, whose end is the next release
    turn: Int[Array, ""]
    # times of this impact and of the previous one, relative to that release
    tau: Float[Array, ""]
    tau_before: Float[Array, ""]
    count: Int[Array, ""]
    # lambda and number (in its period) of the impact that defines the margin
    taken: Float[Array, ""]
    rank: Int[Array, ""]
    # number of impacts in the current period so far
    here: Int[Array, ""]


def chatter_accumulation(
    system: HybridSystem, time=0.0, periods: int = 1
) -> ChatterOrbit:
    """Compute where the chatter of an orbit that sticks once per period accumulates.

    After sticking, the motion does not depend on the past: the orbit leaves the release
    point with zero relative velocity. The chatter is interrupted if `accumulation`
    reaches the last release; `margin` is a smooth form of that condition. Let K be the
    coordinate in which the lambda-map is a multiplication by 1/q
    ([`variational.koenigs`][]), lambda_k the value of lambda at impact k, and tau_k the
    time of that impact relative to release. Then q^k K(lambda_k) is the same for every
    impact of the last period, up to terms of order q^k tau_k, and is zero at the
    interruption. The function is pure: it can be compiled, batched and differentiated
    in forward mode.

    Args:
        system: A system with two states, one constraint and a period.
        time: As in [`variational.chatter_frame`][].
        periods: Number of forcing periods from release to the next release after
            sticking.

    Returns:
        A [`variational.chatter.ChatterOrbit`][].

    Raises:
        ValueError: The system has no period.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import chatter_accumulation
        >>> system = ImpactOscillator(omega=0.5, restitution=0.5)
        >>> bool(chatter_accumulation(system).complete)
        True
    """
    check_chatter_system(system)
    return _orbit(as_arrays(system), jnp.asarray(time, jnp.float64), periods)


@program
def _orbit(system, time, periods) -> ChatterOrbit:
    return prepared_orbit(system.prepared(), time, periods)


def prepared_orbit(system, time, periods: int = 1) -> ChatterOrbit:
    """Return the orbit of a system that is already `prepared`."""
    return orbit_from(system, prepared_frame(system, time), periods)


def orbit_from(system, frame: ChatterFrame, periods: int = 1) -> ChatterOrbit:
    """Return the orbit of a system that is already `prepared`, from a known release."""
    period = system.period
    restitution = frame.restitution
    law = scaling_law(restitution)
    half = law.lambda_bar / 2

    def coordinate(tau, speed):
        # lambda does not exist after release: replace tau by a valid number
        early = tau < -_NEAR * period
        safe = jnp.where(early, tau, -period)
        return early, speed / (frame.jerk * safe * safe)

    def goes_on(s):
        before = (s.turn < periods) | (s.tau < -_NEAR * period) | (s.count == 0)
        return s.found & ~s.settled & before & (s.count < _IMPACTS)

    def hop(s):
        # a motion that just misses the constraint near release may hit it only in the
        # next period
        point = next_impact(system, s.time, s.state, s.speed, 2 * period)
        since = point.time - frame.release
        passed = jnp.floor(jax.lax.stop_gradient(since) / period).astype(s.turn.dtype)
        turn = jnp.clip(passed + 1, s.turn, periods)
        tau = since - turn.astype(jnp.float64) * period
        early, lam = coordinate(tau, point.speed)
        push = normal_acceleration(system, point.time, point.state)[0]
        small = point.speed * frame.jerk <= _SMALL * (1 - restitution) * push * push
        new = turn > s.turn
        rank, here = jnp.where(new, -1, s.rank), jnp.where(new, 0, s.here)
        # take the last impact before release whose lambda is not far below lambda_bar
        take = point.found & early & (turn == periods) & ((lam >= half) | (rank < 0))
        return _Search(
            time=point.time,
            state=point.state,
            speed=point.speed,
            found=point.found,
            settled=point.found & early & (push < 0) & small,
            turn=turn,
            tau=tau,
            tau_before=s.tau,
            count=s.count + 1,
            taken=jnp.where(take, lam, s.taken),
            rank=jnp.where(take, here, rank),
            here=here + 1,
        )

    start = _Search(
        time=frame.release,
        state=frame.state,
        speed=jnp.zeros(()),
        found=jnp.asarray(True),
        settled=jnp.asarray(False),
        turn=jnp.asarray(1),
        tau=-period,
        tau_before=-period,
        count=jnp.asarray(0),
        taken=jnp.asarray(jnp.nan),
        rank=jnp.asarray(-1),
        here=jnp.asarray(0),
    )
    s = while_loop(goes_on, hop, start)

    complete = s.settled & (s.turn == periods)
    on_wall = (
        s.state
        + (s.speed - normal_velocity(system, s.time, s.state)[0])
        * normal_directions(system, s.time, s.state)[0]
    )
    ends = chatter_completion(system, s.time, on_wall).time
    margin = koenigs(s.taken, law.lambda_bar, restitution, law.q) * jnp.exp(
        s.rank.astype(jnp.float64) * jnp.log(law.q)
    )
    # an impact soon after release still belongs to the sequence: by the lambda-map, it
    # follows release within half of the time from the previous impact to release
    local = s.found & (s.tau < jnp.abs(s.tau_before))
    listed = jnp.where(complete | local, s.count, s.count - 1)
    return ChatterOrbit(
        frame=frame,
        accumulation=jnp.where(complete, ends, jnp.nan),
        complete=complete,
        margin=jnp.where(s.rank < 0, jnp.nan, margin),
        impacts=listed,
    )
