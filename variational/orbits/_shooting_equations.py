"""Multiple shooting with one segment per flight and the impact times as unknowns.

An orbit with m impacts is given by the times t_k and the states x_k just after each
impact. With phi the free flight and H and R the gap and impact law of the constraint
that is hit,

    H(t_{k+1}, phi(t_{k+1}; t_k, x_k)) = 0,
    x_{k+1} = R(t_{k+1}, phi(t_{k+1}; t_k, x_k)),

closed by t_{m+1} = t_1 + n T, x_{m+1} = x_1 with n forcing periods T. These equations
contain no division by an impact speed, so they are as regular at grazing as elsewhere.
Beyond grazing, their solutions continue as motions through the constraint, which `seen`
detects.
"""

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.surface import gaps, impacts, normal_velocity
from jaxcam.parameters import AnyArray

from ._flight import flight_end, flight_nodes
from ._gap_sizes import gap_sizes
from ._lowest_gap import gap_or_speed, lowest_times, nodes_of


class Seen(NamedTuple):
    """Quantities that decide whether a solution of the shooting equations is
    admissible, and the flights from which they are computed.
    """

    gaps: Float[Array, " flights"]
    """Lowest gap within each flight, or in the entire orbit if there are no impacts,
    shape `(m,)`.
    """
    speeds: Float[Array, " m"]
    """Approach speed of each impact, positive if it is physical, shape `(m,)`."""
    error: Float[Array, ""]
    """Estimated error of the flights, relative to 1 + |x|."""
    gap_size: Float[Array, ""]
    """Scale of the gaps, in the unit of the gaps."""
    times: Float[Array, "flights nodes"]
    """Times at the ends of all steps (s), shape `(flights, 1 + steps)`."""
    states: Float[Array, "flights nodes n"]
    """States at `times`, shape `(flights, 1 + steps, n)`."""


class AbstractShooting(eqx.Module):
    """The equations of a periodic orbit, for a fixed number of rows of unknowns.

    Each row is the phase of an impact and the state after it. Rows beyond the number of
    impacts are padding: their equations are u = 0. Without rows, the unknowns are the
    state at time zero.
    """

    constraints: eqx.AbstractVar[Any]
    """Constraint hit at each impact, in order."""
    periods: eqx.AbstractVar[Any]
    """Number of forcing periods after which the orbit repeats; 0 without forcing."""
    dimension: eqx.AbstractVar[int]
    """Number of states n."""
    steps: eqx.AbstractVar[int]
    """Number of eighth-order Runge-Kutta steps in each flight."""

    @property
    @abc.abstractmethod
    def rows(self) -> int:
        """Number of rows (static)."""

    @property
    @abc.abstractmethod
    def forced(self) -> bool:
        """Whether the system is forced (static)."""

    @property
    @abc.abstractmethod
    def most_periods(self) -> int:
        """Upper bound on `periods` (static)."""

    @property
    @abc.abstractmethod
    def number(self) -> int | AnyArray:
        """Number of impacts."""

    @property
    @abc.abstractmethod
    def hits(self) -> AnyArray:
        """Constraint hit at each impact, shape `(rows,)`."""

    @property
    def turns(self) -> Float[Array, ""]:
        """Period of the orbit in the unit of the phases; 1 without forcing."""
        return jnp.asarray(self.periods if self.forced else 1, dtype=jnp.float64)

    @property
    def real(self) -> Bool[Array, " rows"]:
        """Whether a row belongs to an impact, shape `(rows,)`."""
        return jnp.arange(self.rows) < self.number

    @property
    def following(self) -> Int[Array, " rows"]:
        """Row of the next impact, shape `(rows,)`; for a row of padding, the row after
        the first.
        """
        k = jnp.where(self.real, jnp.arange(self.rows), 0)
        return jnp.where(k + 1 < self.number, k + 1, 0)

    @property
    def last(self) -> Bool[Array, " rows"]:
        """Whether a row is that of the last impact, shape `(rows,)`."""
        return jnp.arange(self.rows) == self.number - 1

    def residual(self, u, system: HybridSystem) -> Float[Array, " u"]:
        """Return the residual: the gap at each impact, and the mismatch of the impact
        law.

        Args:
            u: Unknowns of the equations, shape `(u,)`.
            system: The system.

        Returns:
            The residual, shape `(u,)`; zero for an orbit.
        """
        if not self.rows:
            end = self.period(u, system)
            start = jnp.zeros_like(end)
            return flight_end(system, start, u, end, steps=self.steps) - u
        starts, ends = self.segments(u, system)
        before = self.arrivals(system, starts, ends)

        def one(end, x, which):
            gap = gaps(system, end[0], x)[which]
            after = impacts(system, end[0], x)[which]
            return jnp.concatenate([gap[None], end[1:] - after])

        found = jax.vmap(one)(ends, before, self.hit())
        return jnp.where(self.real[:, None], found, u.reshape(found.shape)).reshape(-1)

    def period(self, u, system: HybridSystem) -> Float[Array, ""]:
        """Return the period of the orbit (s).

        Args:
            u: Unknowns of the equations, shape `(u,)`.
            system: The system.

        Returns:
            A scalar.
        """
        if not self.forced:
            return u[0]
        return self.turns * jnp.asarray(system.period, dtype=jnp.float64)

    def segments(self, u, system: HybridSystem):
        """Return the starts and ends of the flights: times (s) and states.

        The rows of padding repeat the first flight, so that all rows belong to an
        actual motion.

        Args:
            u: Unknowns of the equations, shape `(u,)`.
            system: The system.

        Returns:
            Two arrays, `(rows, 1 + n)` each.
        """
        starts = u.reshape(self.rows, 1 + self.dimension)
        if not self.forced:
            starts = starts.at[0, 0].set(0.0)
        ends = starts[self.following]
        ends = ends.at[:, 0].add(jnp.where(self.last, self.turns, 0.0))
        starts, ends = (
            jnp.where(self.real[:, None], rows, rows[0]) for rows in (starts, ends)
        )
        unit = self.period(u, system) / self.turns
        scale = jnp.ones(1 + self.dimension).at[0].set(unit)
        return starts * scale[None, :], ends * scale[None, :]

    def flights(self, u, system: HybridSystem):
        """Return the starts and end times of all flights.

        Args:
            u: Unknowns of the equations, shape `(u,)`.
            system: The system.

        Returns:
            Starts `(rows, 1 + n)` and end times `(rows,)`.
        """
        if self.rows:
            starts, ends = self.segments(u, system)
            return starts, ends[:, 0]
        start = jnp.concatenate([jnp.zeros(1), u])
        return start[None], self.period(u, system)[None]

    def hit(self) -> Int[Array, " rows"]:
        """Return the index of the constraint that ends each flight.

        Returns:
            Shape `(rows,)`.
        """
        return jnp.asarray(self.hits)[self.following]

    def arrivals(self, system: HybridSystem, starts, ends) -> Float[Array, "rows n"]:
        """Return the states before the impacts that end the flights.

        Args:
            system: The system.
            starts: Starts of the flights, `(rows, 1 + n)`.
            ends: Ends of the flights, `(rows, 1 + n)`; only their times (s) are used.

        Returns:
            Shape `(rows, n)`.
        """
        return jax.vmap(
            lambda a, b: flight_end(system, a[0], a[1:], b[0], steps=self.steps)
        )(starts, ends)

    def speeds(self, system: HybridSystem, ends, before) -> Float[Array, " rows"]:
        """Return the approach speeds of the impacts.

        Args:
            system: The system.
            ends: Times of the impacts, `(rows,)` (s).
            before: States before the impacts, `(rows, n)`.

        Returns:
            Shape `(rows,)`.
        """
        found = jax.vmap(lambda t, x, which: -normal_velocity(system, t, x)[which])(
            ends, before, self.hit()
        )
        # the flight of row k ends in impact k + 1
        return jnp.zeros_like(found).at[self.following].set(found)

    # -- admissibility

    def seen(self, u, system: HybridSystem) -> Seen:
        """Return lowest gaps, approach speeds and the error from one integration of the
        flights.

        For derivatives, use `gap_or_speed`.

        Args:
            u: Unknowns of the equations, shape `(u,)`.
            system: The system.

        Returns:
            A [`variational.orbits.Seen`][].
        """
        starts, ends = self.flights(u, system)

        def one(start, end):
            nodes = nodes_of(system, start, end, self.steps)
            gap = lowest_times(system, start, end, self.steps, not self.rows, nodes)[1]
            return *nodes, jnp.min(gap)

        times, states, wrong, lowest = jax.vmap(one)(starts, ends)
        speeds = jnp.zeros(0)
        if self.rows:
            speeds = self.speeds(system, ends, states[:, -1])
        start, period = starts[0], self.period(u, system)
        size = jnp.min(gap_sizes(system, start[0], start[1:], period))
        return Seen(lowest, speeds, jnp.max(wrong), size, times, states)

    def approach(self, u, system: HybridSystem) -> Float[Array, " rows"]:
        """Return the approach speed of each impact; differentiable.

        Args:
            u: Unknowns of the equations, shape `(u,)`.
            system: The system.

        Returns:
            Shape `(rows,)`.
        """
        starts, ends = self.segments(u, system)
        return self.speeds(system, ends[:, 0], self.arrivals(system, starts, ends))

    def gap_or_speed(self, number, u, system: HybridSystem) -> Float[Array, ""]:
        """Return the lowest gap of a flight or the speed of an impact; differentiable.

        Args:
            number: Index of the flight, or the number of impacts plus the index of the
                impact.
            u: Unknowns of the equations, shape `(u,)`.
            system: The system.

        Returns:
            A scalar.
        """
        starts, ends = self.flights(u, system)
        hit = self.hit() if self.rows else None
        count = self.number if self.rows else 1
        return gap_or_speed(system, starts, ends, number, hit, self.steps, count)

    def stroboscopic(self, u, system: HybridSystem, seen: Seen):
        """Return the states at time zero and at later multiples of the forcing period.

        Args:
            u: Unknowns of the equations, shape `(u,)`.
            system: The system.
            seen: The flights, from `seen`.

        Returns:
            Shape `(periods, n)`; with padding, further rows follow.
        """
        times, states = seen.times, seen.states
        length = self.turns * system.period

        def at(time):
            ago = jnp.mod(time - times[:, 0], length)
            last = jnp.argmin(ago)
            when = times[last, 0] + ago[last]
            k = jnp.searchsorted(times[last], when, side="right") - 1
            k = jnp.clip(k, 0, self.steps - 1)
            return flight_nodes(system, times[last, k], states[last, k], when, 1)[1][-1]

        turns = jnp.arange(self.most_periods, dtype=jnp.float64)
        return jax.vmap(at)(system.period * turns)
