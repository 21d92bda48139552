"""Map one section to the next, impact by impact, through chatter and sticking."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from jaxcam import HybridSystem
from jaxcam.hybrid.lowering import while_loop
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import normal_velocity
from jaxcam.parameters import as_arrays

from ._chatter_frame import ChatterFrame, prepared_frame
from ._free_flight import fly
from ._impact_map import ImpactPoint, next_impact
from ._scalar import check_chatter_system, scalar_gap


_IMPACTS = 2000
# lambda / (1 - r) below which the remaining impacts of a complete sequence change the
# next period by less than rounding
_SMALL = 1e-12


class SectionArrival(eqx.Module):
    """The state of a motion when it arrives at a section."""

    state: Float[Array, "... n"]
    """State, shape `(n,)`."""
    gap: Float[Array, "..."]
    """Gap at the section, more accurate than if computed from the state."""
    velocity: Float[Array, "..."]
    """Normal velocity at the section, more accurate than if computed from the state."""
    impacts: Int[Array, "..."]
    """Number of impacts; for a complete sequence, those before the remaining impacts
    become negligible.
    """
    stuck: Bool[Array, "..."]
    """Whether the motion stuck before the section."""


class _Run(NamedTuple):
    time: Float[Array, ""]
    state: Float[Array, " n"]
    speed: Float[Array, ""]
    height: Float[Array, ""]
    count: Int[Array, ""]
    arrived: Bool[Array, ""]
    stuck: Bool[Array, ""]


def to_section(
    system: HybridSystem,
    frame: ChatterFrame,
    start: ImpactPoint,
    section,
    height: ArrayLike = 0.0,
) -> SectionArrival:
    """Follow a motion, impact by impact, to the time `section`.

    A sequence that becomes negligible before release counts as completed, and the
    motion continues from the release point of `frame`.

    Args:
        system: The system, already `prepared`.
        frame: The frame whose release is between the start and the section.
        start: The start; its time, state and speed are used.
        section: Time of the section (s).
        height: Gap at the start, > 0 in flight.

    Returns:
        A [`variational.chatter.SectionArrival`][].

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import chatter_frame
        >>> from variational.chatter import release_impacts, to_section
        >>> system = ImpactOscillator(omega=0.5, restitution=0.5)
        >>> first = jax.tree.map(lambda x: x[0], release_impacts(system, 1))
        >>> frame = chatter_frame(system, system.period)  # release in the next period
        >>> arrival = to_section(system.prepared(), frame, first, frame.release + 0.1)
        >>> cubic = frame.jerk * 0.1**3 / 6  # first term of the gap after release
        >>> bool(arrival.stuck), round(float(arrival.gap / cubic), 3)
        (True, 0.999)
    """
    section = jnp.asarray(section, jnp.float64)

    def goes_on(run):
        return ~run.arrived & ~run.stuck & (run.count < _IMPACTS)

    def hop(run):
        left = section - run.time
        point = next_impact(system, run.time, run.state, run.speed, left, run.height)
        hit = point.found & (point.time < section)
        tau = point.time - frame.release
        early = tau < 0
        lam = point.speed / (frame.jerk * jnp.where(early, tau * tau, 1.0))
        stuck = hit & early & (lam < _SMALL * (1 - frame.restitution))
        return _Run(
            time=jnp.where(hit, point.time, run.time),
            state=jnp.where(hit, point.state, run.state),
            speed=jnp.where(hit, point.speed, run.speed),
            height=jnp.where(hit, 0.0, run.height),
            count=run.count + hit.astype(run.count.dtype),
            arrived=~hit,
            stuck=stuck,
        )

    run = _Run(
        time=jnp.asarray(start.time, jnp.float64),
        state=start.state,
        speed=jnp.asarray(start.speed, jnp.float64),
        height=jnp.asarray(height, jnp.float64),
        count=jnp.asarray(0),
        arrived=jnp.asarray(False),
        stuck=jnp.asarray(False),
    )
    run = while_loop(goes_on, hop, run)
    time = jnp.where(run.stuck, frame.release, run.time)
    from_state = jnp.where(run.stuck, frame.state, run.state)
    speed = jnp.where(run.stuck, 0.0, run.speed)
    height = jnp.where(run.stuck, 0.0, run.height)
    state, gap, velocity = fly(system, time, from_state, speed, section - time, height)
    return SectionArrival(state, gap, velocity, run.count, run.stuck)


def section_turn(system: HybridSystem, state, phase=0.0) -> SectionArrival:
    """Return the state one period after a given state in flight, with all impacts of
    any chatter in between.

    This stroboscopic map (thesis, eq. 5.1) is accurate to rounding error for impacts of
    any number and speed, unlike a simulation that completes chatter analytically close
    to its interruption. The function is pure: it can be compiled, batched and
    differentiated in forward mode.

    Args:
        system: A system with two states, one constraint and a period.
        state: State in flight at time `phase` x period, shape `(2,)`.
        phase: Phase of the section, in periods.

    Returns:
        A [`variational.chatter.SectionArrival`][].

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational import section_turn
        >>> system = ImpactOscillator(omega=0.5, restitution=0.5)
        >>> bool(section_turn(system, jnp.array([-0.5, 0.0]), 0.5).stuck)
        True
    """
    check_chatter_system(system)
    return _turn(as_arrays(system), jnp.asarray(state, jnp.float64), phase)


@program
def _turn(system, state, phase) -> SectionArrival:
    system = system.prepared()
    time = jnp.asarray(phase * system.period, jnp.float64)
    frame = prepared_frame(system, time)
    start, height = flight_start(system, time, state)
    return to_section(system, frame, start, time + system.period, height)


def flight_start(system, time, state):
    """Return the start of a flight at a state off the surface, and the gap there."""
    state = jnp.asarray(state, jnp.float64)
    speed = normal_velocity(system, time, state)[0]
    yes = jnp.asarray(True)
    return ImpactPoint(time, state, speed, speed, yes), scalar_gap(system, time, state)


def release_impacts(system: HybridSystem, count: int, time=0.0) -> ImpactPoint:
    """Return the first `count` impacts of the orbit that starts at release.

    Args:
        system: The system.
        count: Number of impacts.
        time: As in [`variational.chatter_frame`][].

    Returns:
        A [`variational.chatter.ImpactPoint`][] with a leading axis of impacts. The
            times are in the period that starts at the release of `chatter_frame(system,
            time)`; `found` is false from the first flight that does not return.

    Raises:
        ValueError: The system has no period.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational.chatter import release_impacts
        >>> impacts = release_impacts(ImpactOscillator(omega=1.0, restitution=0.5), 3)
        >>> np.asarray(impacts.time).round(4).tolist()
        [6.0642, 7.951, 12.1986]
        >>> np.asarray(impacts.speed / -impacts.approach).round(6).tolist()
        [0.5, 0.5, 0.5]
    """
    check_chatter_system(system)
    return _from_release(as_arrays(system), count, jnp.asarray(time, jnp.float64))


@program
def _from_release(system, count, time) -> ImpactPoint:
    system = system.prepared()
    frame = prepared_frame(system, time)
    return _following(system, frame.release, frame.state, jnp.zeros(()), 0.0, count)


def _following(system, time, state, speed, height, count) -> ImpactPoint:
    def hop(carry, _):
        point, height = carry
        after = next_impact(
            system, point.time, point.state, point.speed, system.period, height
        )
        after = eqx.tree_at(lambda p: p.found, after, after.found & point.found)
        return (after, jnp.zeros(())), after

    start = ImpactPoint(time, state, speed, -speed, jnp.asarray(True))
    carry = (start, jnp.asarray(height, jnp.float64))
    return jax.lax.scan(hop, carry, length=count)[1]


def impact_after(system, time, state, speed, height, rank) -> ImpactPoint:
    """Return impact number `rank`, from 0, after a start on or off the surface.

    `rank` may be an array, so that one program is used for all ranks.
    """
    start = ImpactPoint(time, state, speed, -speed, jnp.asarray(True))

    def hop(_, carry):
        point, height = carry
        after = next_impact(
            system, point.time, point.state, point.speed, system.period, height
        )
        after = eqx.tree_at(lambda p: p.found, after, after.found & point.found)
        return after, jnp.zeros(())

    carry = (start, jnp.asarray(height, jnp.float64))
    return jax.lax.fori_loop(0, jnp.asarray(rank) + 1, hop, carry)[0]


def section_to_impact(system: HybridSystem, state, phase, rank) -> ImpactPoint:
    """Map a state at a section to a later impact (the map Theta; thesis, eq. 6.105).

    Args:
        system: A system with two states, one constraint and a period.
        state: State in flight at time `phase` x period, shape `(2,)`.
        phase: Phase of the section, in periods.
        rank: Number of the impact, 0 for the first.

    Returns:
        An [`variational.chatter.ImpactPoint`][].

    Raises:
        ValueError: The system has no period.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational.chatter import section_to_impact
        >>> dropped = jnp.array([1.0, 0.0])
        >>> point = section_to_impact(BouncingBall(), dropped, phase=0.0, rank=1)
        >>> round(float(point.time), 6)
        1.173961
        >>> round((1 + 2 * 0.8) * (2 * 1.0 / 9.81) ** 0.5, 6)  # (1 + 2 r) sqrt(2 h / g)
        1.173961
    """
    check_chatter_system(system)
    system = as_arrays(system).prepared()
    time = jnp.asarray(phase * system.period, jnp.float64)
    start, height = flight_start(system, time, state)
    return impact_after(system, time, start.state, start.speed, height, rank)
