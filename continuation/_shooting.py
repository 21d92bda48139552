"""Multiple shooting: one segment a flight, the impact times among the unknowns.

An orbit with m impacts is the list of its impacts: time t_k and state x_k just after
each. With phi the free flight and H, R gap and law of the constraint that is hit,

    H(t_{k+1}, phi(t_{k+1}; t_k, x_k)) = 0,
    x_{k+1} = R(t_{k+1}, phi(t_{k+1}; t_k, x_k)),

closed by t_{m+1} = t_1 + n T, x_{m+1} = x_1. Nothing in these equations divides by an
impact speed, so they are as regular at grazing as elsewhere; they go on behind it, to
motions through the constraint, which the monitors mark and the checks refuse.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid._normal import gaps, impacts, normal_velocity

from ._admissible import DIP, IMPACT, inadmissible
from ._lowest_gap import dips, gap_or_speed
from ._orbit_grazing import orbit_grazing
from ._problem import AbstractProblem, Monitor, Stability, Start
from ._run_twice import run_twice
from ._shooting_flight import flight_end
from ._shooting_linear import antiperiodic, monodromy, return_map
from ._shooting_map import around_the_period, equations_and_monodromy
from ._shooting_seen import monitors_and_observed


class ImpactingOrbits(AbstractProblem):
    """Periodic orbits of a hybrid system with a known sequence of impacts.

    The unknowns are, for each impact, its phase (time in forcing periods) and the state
    after it: shape `(m (1 + n),)`. Without impacts they are the state at time zero,
    shape `(n,)`. For a system without forcing the first phase is zero, its place taken
    by the period (s), and phases count periods of the orbit.

    **Arguments:**

    - `parameters`: the [`jaxcam.hybrid.HybridSystem`][].
    - `constraints`: which constraint each impact hits, in order.
    - `periods`: forcing periods until the orbit repeats; 0 for a system without
      forcing.
    - `dimension`: number of states n.
    - `steps`: Runge-Kutta steps of order eight in each flight.
    """

    stability: ClassVar[Stability] = "map"

    parameters: HybridSystem
    constraints: tuple[int, ...] = eqx.field(static=True)
    periods: int = eqx.field(static=True)
    dimension: int = eqx.field(static=True)
    steps: int = eqx.field(static=True, default=32)

    def __check_init__(self):
        if self.periods == 0 and not self.constraints:
            raise ValueError(
                "an orbit without forcing and without impacts has no section to be "
                "found on; follow it as a smooth boundary value problem"
            )

    # -- the equations

    def residual(self, u, parameters) -> Float[Array, " n"]:
        if not self.constraints:
            end = self.period(u, parameters)
            start = jnp.zeros_like(end)
            return flight_end(parameters, start, u, end, steps=self.steps) - u
        return self.defects(parameters, *self.segments(u, parameters))

    def linearisation(self, u, parameters, jacobian) -> Float[Array, "k k"]:
        """The monodromy matrix, of the state just after the first impact.

        Without forcing, that of the return map to the constraint.
        """
        if not self.constraints:
            return jacobian + jnp.eye(self.dimension)
        matrix = monodromy(self, u, parameters)
        return matrix if self.periods else return_map(self, u, parameters, matrix)

    def local_jacobian(self, u, parameters):
        """Of the map from the first impact to the one a period later.

        In its phase and the state after it, without forcing in the state alone.
        """
        return around_the_period(self, u, parameters)

    def derivatives(self, u, p, parameters_at):
        """Both from one Jacobian of each flight."""
        if not self.constraints or not self.periods:
            return AbstractProblem.derivatives(self, u, p, parameters_at)
        return equations_and_monodromy(self, u, p, parameters_at)

    @property
    def dear(self) -> bool:
        return True

    def period(self, u, parameters) -> Float[Array, ""]:
        """Period of the orbit (s)."""
        if self.periods == 0:
            return u[0]
        return jnp.asarray(self.periods * parameters.period, dtype=jnp.float64)

    def segments(self, u, parameters):
        """Starts and ends of the flights: times (s) and states, two `(m, 1 + n)`."""
        starts = u.reshape(len(self.constraints), 1 + self.dimension)
        if self.periods == 0:
            starts = starts.at[0, 0].set(0.0)
        ends = self.next_rows(starts).at[-1, 0].add(max(self.periods, 1))
        unit = self.period(u, parameters) / max(self.periods, 1)
        scale = jnp.ones(1 + self.dimension).at[0].set(unit)
        return starts * scale[None, :], ends * scale[None, :]

    def next_rows(self, rows, last=1.0):
        """Each row replaced by the next; `last` multiplies the one that wraps."""
        return jnp.concatenate([rows[1:], last * rows[:1]])

    def arrivals(self, parameters, starts, ends):
        """States before the impacts, shape `(m, n)`."""
        return jax.vmap(
            lambda a, b: flight_end(parameters, a[0], a[1:], b[0], steps=self.steps)
        )(starts, ends)

    def hit(self):
        """Index of the constraint that ends each flight."""
        return jnp.asarray(self.constraints[1:] + self.constraints[:1])

    def defects(self, parameters, starts, ends):
        """Gap at each impact, and what its law misses, shape `(m (1 + n),)`."""
        before = self.arrivals(parameters, starts, ends)

        def one(end, x, which):
            gap = gaps(parameters, end[0], x)[which]
            after = impacts(parameters, end[0], x)[which]
            return jnp.concatenate([gap[None], end[1:] - after])

        return jax.vmap(one)(ends, before, self.hit()).reshape(-1)

    # -- what to watch

    def speeds(self, u, parameters) -> Float[Array, " m"]:
        """Approach speed of each impact, positive where it is physical."""
        starts, ends = self.segments(u, parameters)
        before = self.arrivals(parameters, starts, ends)
        return self.speeds_at(parameters, ends[:, 0], before)

    def speeds_at(self, parameters, ends, before):
        """Approach speeds from the states `before` the impacts at times `ends` (s)."""
        found = jax.vmap(
            lambda end, x, which: -normal_velocity(parameters, end, x)[which]
        )(ends, before, self.hit())
        # the flight of row k ends in impact k + 1
        return jnp.roll(found, 1)

    def flights(self, u, parameters):
        """Starts `(m, 1 + n)` and end times `(m,)` of all flights."""
        if self.constraints:
            starts, ends = self.segments(u, parameters)
            return starts, ends[:, 0]
        start = jnp.concatenate([jnp.zeros(1), u])
        return start[None], self.period(u, parameters)[None]

    def monitor(self, u, parameters) -> dict[str, Float[Array, ""]]:
        starts, ends = self.flights(u, parameters)
        lowest = dips(
            parameters, starts, ends, self.steps, whole_turn=not self.constraints
        )
        found = {f"{DIP} {k}": lowest[k] for k in range(lowest.shape[0])}
        if self.constraints:
            speeds = self.speeds(u, parameters)
            found |= {f"{IMPACT} {k}": speeds[k] for k in range(len(self.constraints))}
        return found

    def monitors(self) -> Mapping[str, Monitor]:
        m = len(self.constraints)
        names = [f"{DIP} {k}" for k in range(max(m, 1))]
        names += [f"{IMPACT} {k}" for k in range(m)]
        return {name: Monitor(kind="grazing", ends=True) for name in names}

    def vanishing_with(self, name: str) -> tuple[str, ...]:
        """The gaps of the flights beside an impact without speed."""
        m = len(self.constraints)
        if not name.startswith(IMPACT):
            return ()
        number = int(name.rsplit(" ", 1)[1])
        return f"{DIP} {(number - 1) % m}", f"{DIP} {number}"

    def watched(self, name: str, u, parameters) -> Float[Array, ""]:
        number = int(name.rsplit(" ", 1)[1])
        if name.startswith(IMPACT):
            return self.speeds(u, parameters)[number]
        starts, ends = self.flights(u, parameters)
        whole = not self.constraints
        return dips(parameters, starts, ends, self.steps, whole_turn=whole)[number]

    def watched_by_number(self, number, u, parameters) -> Float[Array, ""]:
        starts, ends = self.flights(u, parameters)
        hit = self.hit() if self.constraints else None
        return gap_or_speed(parameters, starts, ends, number, hit, self.steps)

    def observe(self, u, parameters) -> dict[str, Array]:
        """Period (s); time (s) and state after the first impact; integration error;
        with forcing, the states at whole forcing periods, `(periods, n)`."""
        return self.seen(u, parameters)[1]

    def seen(self, u, parameters):
        return monitors_and_observed(self, u, parameters)

    # -- between compiled programs

    def check(self, point: Any) -> str | None:
        return inadmissible(self, point)

    def transition(self, point: Any) -> Start | None:
        return orbit_grazing(self, point)

    def doubled(self, point: Any, direction) -> Start | None:
        del direction
        u = jnp.asarray(point.state)
        parameters = point.problem.parameters
        matrix = np.asarray(antiperiodic(self, u, parameters))
        deviation = np.linalg.svd(matrix)[2][-1]
        state, tangent = run_twice(self, np.asarray(point.state), deviation)
        twice = ImpactingOrbits(
            parameters,
            2 * self.constraints,
            2 * self.periods,
            self.dimension,
            self.steps if self.constraints else 2 * self.steps,
        )
        return Start(twice, state, float(point.parameter), np.append(tangent, 0.0))

    @property
    def signature(self) -> str:
        hits = ".".join(map(str, self.constraints)) or "-"
        return f"impacts {hits} periods {self.periods} steps {self.steps}"

    def with_signature(self, signature: str) -> "ImpactingOrbits":
        words = signature.split()
        if words[0::2] != ["impacts", "periods", "steps"]:
            raise ValueError(
                f"the saved branch has signature {signature!r}, which is no sequence "
                "of impacts; take it up with the problem it was made with"
            )
        hits = () if words[1] == "-" else tuple(map(int, words[1].split(".")))
        periods, steps = int(words[3]), int(words[5])
        return ImpactingOrbits(self.parameters, hits, periods, self.dimension, steps)
