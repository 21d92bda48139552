"""Compute flights with their final impacts, and all derivatives of an orbit.

One Jacobian of each flight with respect to its initial state gives the matrix of the
shooting equations, the derivative of one impact with respect to another, and the
monodromy matrix, which can also be split into a regular part and a part that grows as
an impact becomes grazing.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.surface import gaps, impacts

from ._flight import flight_nodes
from ._shooting_equations import AbstractShooting


# Newton iterations for an impact time that is known to a part in a hundred
_EVALUATIONS = 5


class Link(NamedTuple):
    """A flight and the impact at its end: gap, state after the impact, and
    derivatives.
    """

    value: Float[Array, " 1+n"]
    """Gap on arrival and state after the impact, (1 + n,)."""
    by_start: Float[Array, "1+n 1+n"]
    """Derivatives with respect to initial time (s) and state, (1 + n, 1 + n)."""
    by_end: Float[Array, " 1+n"]
    """Derivatives with respect to the time of arrival (s), (1 + n,)."""
    field: Float[Array, " n"]
    """Vector field after the impact, (n,)."""

    @property
    def by_impact(self) -> Float[Array, "k k"]:
        """Return the derivative of time and state of the impact with respect to those
        at the start.
        """
        sooner = -self.by_start[0] / self.by_end[0]
        moved = self.by_start[1:] + jnp.outer(self.by_end[1:], sooner)
        return jnp.concatenate([sooner[None], moved])

    @property
    def parts(self) -> tuple[Float[Array, "n n"], Float[Array, "n n"], Array]:
        """Return the derivative of the final state with respect to the initial state,
        each at its own time, as regular + singular / speed; the speed is the normal
        velocity on arrival.
        """
        left = jnp.outer(self.field - self.by_end[1:], self.by_start[0, 1:])
        return self.by_start[1:, 1:], left, self.by_end[0]


def landed(
    system: HybridSystem, start, time, which, before, by_state: Float[Array, "n n"]
) -> Link:
    """Return the link of a flight from a row (time, state), given the state `before`
    the impact at its end and the derivative `by_state` of that state with respect to
    the initial state.
    """

    def arrive(t, x):
        return jnp.append(gaps(system, t, x)[which], impacts(system, t, x)[which])

    value = arrive(time, before)
    by_time, by_before = jax.jacfwd(arrive, argnums=(0, 1))(time, before)
    by_x = by_before @ by_state
    # starting later from the same state is the same as starting at the original time
    # from that state, carried back along the flow
    by_t = -by_x @ system.vector_field(start[0], start[1:])
    return Link(
        value,
        jnp.concatenate([by_t[:, None], by_x], axis=1),
        by_time + by_before @ system.vector_field(time, before),
        system.vector_field(time, value[1:]),
    )


def link(system: HybridSystem, start, time, which, steps: int) -> Link:
    """Return the flight from a row (time, state) to `time` (s), with the impact at its
    end.
    """

    def flown(x):
        before = flight_nodes(system, start[0], x, time, steps)[1][-1]
        return before, before

    by_state, before = jax.jacfwd(flown, has_aux=True)(start[1:])
    return landed(system, start, time, which, before, by_state)


def matrix_of(links: Link, following, sign: Any = 1.0, real: Any = True):
    """Return the derivative of all equations (gap, next state - state after impact)
    with respect to all rows.

    **Arguments:** `links` of shape `(m, ...)`; `following`, the index of the next row
    for each row; `sign`, factors of the entries for the next row; `real`, which marks
    the valid rows (the others are replaced by those of the identity).

    Returns:
        Shape `(m (1 + n), m (1 + n))`, times in s.
    """
    m, size = links.value.shape
    first = jnp.zeros(size).at[0].set(1.0)
    keeps = jnp.diag(1.0 - first)
    flip = jnp.diag(2 * first - 1.0)

    def blocks(link, sign, real):
        later = sign * keeps.at[:, 0].add(flip @ link.by_end)
        own = jnp.where(real, flip @ link.by_start, jnp.eye(size))
        return own, jnp.where(real, later, 0.0)

    each = (jnp.broadcast_to(jnp.asarray(value), (m,)) for value in (sign, real))
    own, later = jax.vmap(blocks)(links, *each)
    k = jnp.arange(m)
    whole = jnp.zeros((m, m, size, size)).at[k, k].add(own)
    whole = whole.at[k, following].add(later)
    return whole.transpose(0, 2, 1, 3).reshape(m * size, m * size)


def links_of(shooting: AbstractShooting, u, system: HybridSystem) -> Link:
    """Return the links of an orbit, `(m, ...)`."""
    starts, ends = shooting.flights(u, system)
    return jax.vmap(lambda a, b, which: link(system, a, b, which, shooting.steps))(
        starts, ends, shooting.hit()
    )


def product_of_links(
    shooting: AbstractShooting, links: Link, number: Int[Array, ""] | None = None
) -> tuple[Float[Array, "n n"], Float[Array, "n n"]]:
    """Return the monodromy matrix for the state just after the first impact.

    With the `number` of an impact, the result is two matrices, which are bounded even
    if that impact is grazing: the monodromy matrix is the first plus the second divided
    by the normal velocity on arrival. Without `number`, the second matrix is zero.
    """
    n = links.field.shape[1]

    def extend(product, known):
        first, second = product
        one, following, real = known
        regular, singular, speed = one.parts
        whole = regular + singular / jnp.where(real, speed, 1.0)
        # the flight of a row ends in the following impact
        mine = False if number is None else following == number
        longer = (
            jnp.where(mine, regular @ first, whole @ first),
            jnp.where(mine, singular @ first, whole @ second),
        )
        return jax.tree.map(lambda a, b: jnp.where(real, a, b), longer, product), None

    begin = (jnp.eye(n), jnp.zeros((n, n)))
    known = links, shooting.following, shooting.real
    return jax.lax.scan(extend, begin, known)[0]


def monodromy_of(
    shooting: AbstractShooting, u, system: HybridSystem
) -> Float[Array, "n n"]:
    """Return the derivative of the state one period after the first impact with respect
    to the state at that impact.
    """
    return product_of_links(shooting, links_of(shooting, u, system))[0]


def antiperiodic(
    shooting: AbstractShooting, u, system: HybridSystem
) -> Float[Array, "u u"]:
    """Return the derivative of the equations for a deviation that changes sign each
    period.

    It is singular at a flip, where its null vector is the deviation of the
    period-doubled orbit. The first column belongs to the first phase, even without
    forcing.
    """
    if not shooting.rows:
        return jax.jacfwd(shooting.residual)(u, system) + 2 * jnp.eye(u.size)
    sign = jnp.where(shooting.last, -1.0, 1.0)
    links = links_of(shooting, u, system)
    whole = matrix_of(links, shooting.following, sign, shooting.real)
    return whole * _column_scale(shooting, u, system)


def equations_and_monodromy(
    shooting: AbstractShooting, u, p, system_at: Callable
) -> tuple[Float[Array, "u u+1"], Float[Array, "n n"]]:
    """Return the derivative of the equations with respect to unknowns and parameter,
    and the monodromy matrix.

    The orbit must have impacts; the system is `system_at(p)`.
    """
    system = system_at(p)
    starts, ends = shooting.flights(u, system)

    def one(start, time, which):
        def flown(joined):
            before = flight_nodes(
                system_at(joined[-1]), start[0], joined[:-1], time, shooting.steps
            )[1][-1]
            return before, before

        by, before = jax.jacfwd(flown, has_aux=True)(jnp.append(start[1:], p))
        found = landed(system, start, time, which, before, by[:, :-1])

        def arrive(x, p):
            moved = system_at(p)
            gap, after = gaps(moved, time, x)[which], impacts(moved, time, x)[which]
            return jnp.append(gap, after)

        by_p = jax.jvp(arrive, (before, p), (by[:, -1], jnp.ones_like(p)))[1]
        return found, by_p

    links, by_p = jax.vmap(one)(starts, ends, shooting.hit())
    whole = matrix_of(links, shooting.following, real=shooting.real)
    whole = whole * _column_scale(shooting, u, system)
    row = -jnp.ones(1 + shooting.dimension).at[0].set(-1.0)
    flip = jnp.where(shooting.real[:, None], row, 0.0).reshape(-1)
    # all times are phases times one unit (s)
    unit = shooting.period(u, system) / shooting.turns
    by_unit = jax.vmap(
        lambda one, t0, t1: (one.by_start[:, 0] * t0 + one.by_end * t1) / unit
    )(links, starts[:, 0], ends)
    if shooting.forced:
        rate = jax.jvp(
            lambda p: jnp.asarray(system_at(p).period, dtype=jnp.float64),
            (p,),
            (jnp.ones_like(p),),
        )[1]
        by_p = by_p + by_unit * rate
    else:
        # the period takes the place of the first phase
        whole = whole.at[:, 0].set(flip * by_unit.reshape(-1))
    by_p = flip * by_p.reshape(-1)
    matrix = product_of_links(shooting, links)[0]
    return jnp.append(whole, by_p[:, None], axis=1), matrix


def _column_scale(shooting: AbstractShooting, u, system) -> Float[Array, "1 u"]:
    """Return the factors that convert derivatives with respect to times (s) to
    derivatives with respect to phases.
    """
    unit = shooting.period(u, system) / shooting.turns
    row = jnp.ones(1 + shooting.dimension).at[0].set(unit)
    return jnp.where(shooting.real[:, None], row, 1.0).reshape(1, -1)


def return_map(shooting: AbstractShooting, u, system: HybridSystem, matrix):
    """Return the derivative of the return map to the first constraint, from the
    monodromy matrix.

    The result refers to coordinates on the surface, and has the shape `(n - 1, n - 1)`.
    """
    starts, _ = shooting.segments(u, system)
    t, x = starts[0, 0], starts[0, 1:]
    which = jnp.asarray(shooting.hits)[0]
    normal = jax.grad(lambda y: gaps(system, t, y)[which])(x)
    along = system.vector_field(t, x)
    along = along / jnp.dot(normal, along)
    basis = jnp.linalg.qr(normal[:, None], mode="complete")[0][:, 1:]
    moved = matrix @ basis
    return basis.T @ (moved - along[:, None] * (normal @ moved)[None, :])


def around_the_period(shooting: AbstractShooting, u, system: HybridSystem):
    """Return the Jacobian of the map from the first impact to the impact one period
    later.

    The map acts on the phase and the state of the impact; without forcing, only on the
    state; without impacts, on the state at time zero.

    Returns:
        The Jacobian as a function of a point, and the point on the orbit.
    """
    if not shooting.rows:
        return jax.jacfwd(lambda x: shooting.residual(x, system) + x), u
    starts, ends = shooting.segments(u, system)

    hits = shooting.hit()

    def hop(k, carry):
        start, matrix = carry
        which = hits[k]

        def improve(_, found):
            time = found[0]
            there = link(system, start, time, which, shooting.steps)
            change = -there.value[0] / there.by_end[0]
            after = there.value[1:] + change * there.by_end[1:]
            return time + change, after, there.by_impact

        first = (ends[k, 0], start[1:], jnp.zeros_like(matrix))
        time, after, moved = jax.lax.fori_loop(0, _EVALUATIONS, improve, first)
        return jnp.append(time, after), moved @ matrix

    def whole_turn(start):
        begin = (start, jnp.eye(start.size))
        return jax.lax.fori_loop(0, shooting.number, hop, begin)[1]

    if not shooting.forced:
        return lambda x: whole_turn(jnp.append(starts[0, :1], x))[1:, 1:], starts[0, 1:]
    unit = shooting.period(u, system) / shooting.turns
    sizes = jnp.ones(starts.shape[1]).at[0].set(unit)

    def of_phase(y):
        return whole_turn(y * sizes) * (sizes[None, :] / sizes[:, None])

    return of_phase, u[: starts.shape[1]]
