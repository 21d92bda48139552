"""Periodic orbits: one period of the motion, its events and its monodromy matrix."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jaxcam.hybrid import (
    HybridSystem,
    Settings,
    simulate,
    SwitchedSystem,
    Trajectory,
)
from jaxcam.hybrid.checks import refuse_tracers
from jaxcam.hybrid.record import Contacts, impact_table, Impacts, Printed, Switches
from jaxcam.hybrid.sizes import component_sizes
from jaxcam.hybrid.surface import gaps
from jaxcam.parameters import real_array, VectorLike
from jaxcam.tables import ShortTable

from ._at_impact import after_and_speeds, ImpactStart, start_at_impact
from ._closing import close, Knots
from ._gap_sizes import gap_sizes
from ._multipliers import eigenvalues
from ._pieces import cut_turn, TurnPieces
from ._turn_derivative import by_flow, by_product, flown


class Event(NamedTuple):
    """One event of an orbit, with its constraint or switching surface."""

    kind: str
    """"impact", "stick" or "release"; at a surface "cross", "slide" or "leave"."""
    constraint: int
    """Index of the constraint or of the surface."""


class Orbit(Printed):
    """One period of a periodic motion.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational import orbit_of
        >>> orbit = orbit_of(BouncingBall(restitution=1.0), [9.81 / 8, 0.0], period=1.0)
        >>> round(float(orbit.determinant), 6)
        1.0
    """

    state: Float[Array, " n"]
    """State at `time`, shape `(n,)`."""
    time: Float[Array, ""]
    """Start of the period (s)."""
    period: Float[Array, ""]
    """Period of the orbit (s); several forcing periods for a subharmonic orbit."""
    impacts: Impacts
    """The impacts of one period."""
    contacts: Contacts
    """The intervals of sustained contact in one period."""
    closure: Float[Array, ""]
    """Largest deviation from the given state after one period, relative to
    [`jaxcam.hybrid.sizes.component_sizes`][].
    """
    monodromy: Float[Array, "n n"]
    """Derivative of the state after one period with respect to `state`, shape `(n, n)`.
    """
    determinant: Float[Array, ""]
    """Determinant of the monodromy matrix, computed as a product over flights and
    impacts.
    """
    pieces: TurnPieces
    """The period, divided at its events."""
    sticks: bool = eqx.field(static=True)
    """Whether the orbit has sustained contact."""
    switches: Switches | None = None
    """The events at switching surfaces in one period; None without surfaces."""

    def _table(self) -> ShortTable:
        """Return a table of the impacts of one period, with a sentence on stability."""
        sizes = ", ".join(f"{abs(m):.3g}" for m in self.multipliers)
        sentence = (
            f"{'stable' if self.stable else 'unstable'} orbit of period "
            f"{float(self.period):.6g} s, impacts: {int(self.impacts.count)}, "
            f"contacts: {int(self.contacts.count)}, "
        )
        if self.switches is not None:
            sentence += f"switches: {int(self.switches.count)}, "
        sentence += f"multipliers of modulus {sizes}"
        return impact_table(self.impacts, sentence)

    @property
    def multipliers(self) -> Complex[Array, " n"]:
        """Floquet multipliers, largest modulus first, shape `(n,)`."""
        return eigenvalues(self.monodromy, self.determinant)

    @property
    def stable(self) -> bool:
        """Return whether all multipliers lie inside the unit circle."""
        return bool(jnp.all(jnp.abs(self.multipliers) < 1))

    @property
    def signature(self) -> tuple[Event, ...]:
        """Events of one period, in order.

        For completed chatter, only the impacts up to the completion are listed.
        """
        return signature_of(self.impacts, self.contacts, self.switches)


def orbit_of(
    system: HybridSystem,
    state: VectorLike,
    period: float | Array | None = None,
    t0: float | Array = 0.0,
    *,
    settings: Settings | None = None,
    closure: float = 1e-6,
) -> Orbit:
    """Return the periodic orbit through `state` at `t0`, from a simulation of one
    period.

    For an orbit without contact, the impacts are then refined by solving a boundary
    value problem, so that the impacts and multipliers are accurate at every impact
    speed. With switching surfaces, the event loop is differentiated instead.

    Args:
        system: The system.
        state: A state to which the motion returns, shape `(n,)`. At an impact, it may
            be the state before or after the impact; the orbit then starts in the middle
            of its first flight, because the flow jumps at an impact and has no
            derivative there.
        period: Period (s); default: the forcing period.
        t0: Time of `state` (s).
        settings: Accuracy of the simulation; the default tolerance is 1e-12.
        closure: Allowed deviation after one period, relative to
            [`jaxcam.hybrid.sizes.component_sizes`][].

    Returns:
        A [`variational.Orbit`][] with its monodromy matrix.

    Raises:
        ValueError: The simulation fails, or the motion does not return to the state.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational import orbit_of
        >>> orbit = orbit_of(BouncingBall(restitution=1.0), [9.81 / 8, 0.0], period=1.0)
        >>> [event.kind for event in orbit.signature]
        ['impact']
    """
    refuse_tracers("orbit_of", "jaxcam.hybrid.flow", system, state, period, t0)
    settings = Settings(tolerance=1e-12) if settings is None else settings
    state = real_array(state)
    t0, period = float(jnp.asarray(t0)), _length(system, period)
    turn = simulate(system, state, t0, t0 + period, settings=settings)
    if not bool(turn.successful):
        raise ValueError(f"the simulation of one period stopped early: {turn.result}")
    system, impacts, contacts = turn.system, turn.impacts, turn.contacts
    sizes = component_sizes(system, t0, state, period)
    away = jnp.abs(turn.final - state)
    miss = float(jnp.max(jnp.where(away > 0, away / sizes, 0.0)))
    start = None
    if gaps(system, t0, state).shape[0]:
        start = start_at_impact(system, t0, state, period)
    switched = isinstance(system, SwitchedSystem)
    polished = (
        int(contacts.count) == 0
        and not switched
        and (start is not None or int(impacts.count) > 0)
    )
    if polished:
        heights = gap_sizes(system, t0, state, period)
        scale = jnp.concatenate([jnp.min(heights)[None], sizes])
        knots, sides = _knots(system, impacts, start, t0, period, scale)
        if start is not None:
            t0 = _half_a_flight_on(knots, t0, period)
            miss = knots.miss
    _check_closure(miss, closure, period)
    _check_mode(turn)
    if polished:
        impacts, state = _rebuilt(system, knots, sides, t0, period)
    elif start is not None:
        raise ValueError(
            "an orbit with contact or switching surfaces cannot start at an impact; "
            "give a state in flight or in contact"
        )
    pieces, sticks = cut_turn(impacts, contacts, state, t0, t0 + period)
    none = jnp.zeros(0)
    if switched:
        times = jnp.asarray(t0), jnp.asarray(period)
        made = by_flow(system, none, None, state, *times, settings, sticks)
    else:
        made = by_product(system, none, None, state, pieces, sticks)
    return Orbit(
        state=state,
        time=jnp.asarray(t0),
        period=jnp.asarray(period),
        impacts=impacts,
        contacts=contacts,
        closure=jnp.asarray(miss),
        monodromy=made.state,
        determinant=made.determinant,
        pieces=pieces,
        sticks=sticks,
        switches=turn.switches,
    )


def _length(system, period) -> float:
    """Return the period of the orbit, by default that of the forcing."""
    if period is None:
        if system.period is None:
            raise ValueError(
                "this system has no forcing period; pass the period of the orbit (s)"
            )
        period = system.period
    period = float(jnp.asarray(period))
    if not period > 0:
        raise ValueError(f"period is {period:g} s; give a positive one")
    return period


def _check_closure(miss, closure, period) -> None:
    if not miss <= closure:
        raise ValueError(
            f"the motion does not return to this state: after {period:g} s, the "
            f"relative difference is {miss:.1e}; give a state and period closer to the "
            "orbit, or find it with continuation.periodic_orbit"
        )


def _knots(system, impacts: Impacts, start: ImpactStart | None, t0, period, scale):
    """Return the impacts, refined by shooting, and the constraints that are hit."""
    time, after = np.asarray(impacts.time), np.asarray(impacts.after)
    sides = np.asarray(impacts.constraint)
    if start is not None:
        # begin with the impact at the start, and omit it at the end of the run
        other = (time > t0) & (time < t0 + period - start.window)
        time = np.append(t0, time[other])
        after = np.concatenate([start.after[None], after[other]])
        sides = np.append(start.constraint, sides[other])
    rows = np.concatenate([time[:, None], after], axis=1)
    return close(system, rows, sides, period, scale), sides


def _check_mode(turn: Trajectory) -> None:
    """Raise `ValueError` if a hybrid automaton returns to its state in another mode."""
    if not (isinstance(turn.system, SwitchedSystem) and turn.system.one_way):
        return
    first, *_, last = turn.modes.names() * 2
    if first != last:
        raise ValueError(
            f"after the period, the motion is in mode {last}, but it started in "
            f"{first}; give another period, or start in another mode (`start_mode`)"
        )


def _half_a_flight_on(knots: Knots, t0, period) -> float:
    time = knots.rows[:, 0]
    later = np.append(time[1:], time[0] + period)
    return float(time[0] + later[0]) / 2


def _rebuilt(system, knots: Knots, sides, t0, period):
    """Return the impacts after t0 in order, and the state at t0, from refined
    impacts.
    """
    time = knots.rows[:, 0]
    time = time + np.where(time <= t0, period, 0.0)
    order = np.argsort(time, kind="stable")
    time, before, sides = time[order], knots.before[order], sides[order]
    after, speed_before, speed_after = after_and_speeds(system, time, before, sides)
    impacts = Impacts(
        time=jnp.asarray(time),
        before=jnp.asarray(before),
        after=jnp.asarray(after),
        constraint=jnp.asarray(sides),
        speed_before=jnp.asarray(speed_before),
        speed_after=jnp.asarray(speed_after),
        count=jnp.asarray(len(time)),
    )
    last = len(time) - 1
    end = jnp.asarray(t0 + period)
    state = flown(system, impacts.time[last], impacts.after[last], end)
    return impacts, state


_AT_SURFACE = ("cross", "slide", "leave")


def signature_of(
    impacts: Impacts, contacts: Contacts, switches: Switches | None = None
) -> tuple[Event, ...]:
    """Return impacts, starts of contact, releases and switches as one sequence in
    time.
    """
    return tuple(event for _, event in events_in_time(impacts, contacts, switches))


def events_in_time(
    impacts: Impacts, contacts: Contacts, switches: Switches | None = None
) -> list[tuple[float, Event]]:
    """Return impacts, starts of contact, releases and switches with their times (s), in
    order.
    """
    found = []
    for k in range(int(impacts.count)):
        found.append((float(impacts.time[k]), 0, "impact", int(impacts.constraint[k])))
    for k in range(int(contacts.count)):
        which = int(contacts.constraint[k])
        found.append((float(contacts.start[k]), 1, "stick", which))
        if bool(contacts.released[k]):
            found.append((float(contacts.end[k]), 2, "release", which))
    for k in range(0 if switches is None else int(switches.count)):
        assert switches is not None
        kind, which = _AT_SURFACE[int(switches.kind[k])], int(switches.surface[k])
        found.append((float(switches.time[k]), 3, kind, which))
    return [(time, Event(kind, which)) for time, _, kind, which in sorted(found)]
