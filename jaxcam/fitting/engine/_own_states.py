"""Fit the states of individual pieces by least squares, from several starts."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...hybrid.programs import program
from ._discrete_starts import all_discrete_ends, most_likely_starts
from ._discrete_states import number_of_discrete_states
from ._ends import ends_of
from ._extras import Extras
from ._layout import Layout
from ._linearise import Point, with_begins
from ._model import DriveState, filtered_channels
from ._pieces import FLIGHT, IMPACT, Pieces
from ._predict import after_impact
from ._sharpness import states_only


# Directions in state space with less than this fraction of the largest information are
# held fixed
_BLIND = 1e-10
# Number of samples needed to determine the curvature of a piece
_FEW = 24
# Mean cost per sample above which the model counts as far from the samples: residuals
# of three times the noise
_FAR = 9.0
# Maximum number of damped steps from each start
_STEPS = 12
# The iteration ends after this many consecutive steps that reduce the cost of no piece
# by more than this fraction
_QUIET, _LITTLE = 3, 1e-3
_FIRST_DAMPING, _LEAST_DAMPING = 1e-3, 1e-9


def own_states(
    layout: Layout,
    pieces: Pieces,
    extras: Extras,
    point: Point,
    others: Sequence[Float[Array, "r k n"]] = (),
) -> Point:
    """Fit the states of pieces that polynomials do not determine.

    A few samples do not determine the curvature of a flight, and with a wrong initial
    velocity, the flight never meets the previous one. Such pieces take one Gauss-Newton
    step without joints. If the model remains far from the samples, for example because
    there are few samples per period, damped steps are taken from several starts: the
    point, `others`, and predictions from the neighbouring pieces. For each piece, the
    best fit is kept.

    If the system has several discrete states, the states are fitted for each of them,
    and the most likely sequence of discrete states is chosen.
    """
    if point.discrete is None:
        return _fitted(layout, pieces, extras, point, others)[0]
    # the states of pieces without weight must be fitted as well, because the discrete
    # states are compared by their costs
    extras = extras._replace(weight=jnp.asarray(pieces.exists, dtype=float))
    size = point.states.shape[-1] - len(filtered_channels(layout.model))
    rivals, costs, follows = [], [], []
    for discrete in range(number_of_discrete_states(layout.model, size)):
        first = jnp.full(pieces.joint.shape, discrete)
        here = point._replace(discrete=first)
        here, cost = _fitted(layout, pieces, extras, here, others, thorough=True)
        rivals.append(np.asarray(here.states))
        costs.append(cost)
        follows.append(np.asarray(all_discrete_ends(layout, pieces, here).follows))
    each = jnp.stack(costs, axis=-1), jnp.stack(follows, axis=-2)
    first = most_likely_starts(layout, pieces, point, *each)
    picked = np.asarray(first)[None, ..., None]
    states = np.take_along_axis(np.stack(rivals), picked, axis=0)[0]
    return Point(point.values, jnp.asarray(states), first)


def _fitted(
    layout: Layout,
    pieces: Pieces,
    extras: Extras,
    point: Point,
    others: Sequence[Float[Array, "r k n"]],
    thorough: bool = False,
) -> tuple[Point, Float[np.ndarray, "r k"]]:
    """Return a point with fitted states, and the cost of each piece.

    **Arguments:** as for `own_states`; `thorough` if pieces that are not far from the
    samples also take damped steps.
    """
    # with NumPy, because JAX would compile each operation for each number of recordings
    alone = eqx.tree_at(lambda p: p.joint, pieces, np.zeros_like(pieces.joint))
    count = np.sum(np.asarray(pieces.flown.known), axis=(-3, -2, -1))
    start = np.asarray(point.states)

    def about(states):
        at = point._replace(states=jnp.asarray(states))
        blocks, costs = states_only(layout, alone, extras, at)
        return np.asarray(blocks.ss), np.asarray(blocks.s), np.asarray(costs.flown)

    ss, s, before = about(start)
    moved = start + _step(ss, s, np.zeros(count.shape))
    *_, after = about(moved)
    better = (count < _FEW) & (after < before)
    states = np.where(better[..., None], moved, start)
    cost = np.where(better, after, before)

    def far():
        # a non-finite cost counts as far
        return np.asarray(pieces.exists) & (count > 0) & ~(cost <= _FAR * count)

    def offer(start):
        nonlocal states, cost
        found, reached = _descended(about, start)
        wins = far() & (reached < np.where(np.isfinite(cost), cost, np.inf))
        states = np.where(wins[..., None], found, states)
        cost = np.where(wins, reached, cost)

    if thorough:
        found, reached = _descended(about, states)
        states = np.where((reached < cost)[..., None], found, states)
        cost = np.fmin(reached, cost)
    for start in (states, *others):
        if np.any(far()):
            offer(start)
    joint = np.asarray(pieces.joint)
    for _ in range(2):
        if not np.any(far()):
            break
        here = point._replace(states=jnp.asarray(states))
        ends, landed = (np.asarray(x) for x in _ends(layout, pieces, here))
        reached = np.where((joint == IMPACT)[..., None], landed, ends)
        reached = np.concatenate([states[:, :1], reached[:, :-1]], axis=1)
        tied = ((joint == FLIGHT) | (joint == IMPACT))[..., None]
        offer(np.where(tied & np.isfinite(reached), reached, states))
    return point._replace(states=jnp.asarray(states)), cost


def _descended(about, start: Float[np.ndarray, "r k n"]):
    """Return states and costs from damped Gauss-Newton steps for each piece separately.

    **Arguments:** `about(states)` returns information and score of the states, and the
    cost of each piece.
    """
    states = np.where(np.isfinite(start), start, 0.0)
    ss, s, cost = about(states)
    cost = np.where(np.isfinite(cost), cost, np.inf)
    damping, quiet = np.full(cost.shape, _FIRST_DAMPING), 0
    for _ in range(_STEPS):
        if quiet == _QUIET:
            break
        moved = states + _step(ss, s, damping)
        *there, tried = about(moved)
        better = tried < cost
        with np.errstate(invalid="ignore", divide="ignore"):
            gain = np.nanmax(np.where(better, 1 - tried / cost, 0.0), initial=0.0)
        quiet = quiet + 1 if gain < _LITTLE else 0
        states = np.where(better[..., None], moved, states)
        cost = np.where(better, tried, cost)
        ss = np.where(better[..., None, None], there[0], ss)
        s = np.where(better[..., None], there[1], s)
        damping = np.where(better, damping / 10, damping * 10)
        damping = np.maximum(damping, _LEAST_DAMPING)
    return states, cost


def _step(
    ss: Float[np.ndarray, "r k n n"],
    s: Float[np.ndarray, "r k n"],
    damping: Float[np.ndarray, "r k"],
) -> Float[np.ndarray, "r k n"]:
    """Return Gauss-Newton steps of the states, scaled by the information in the
    samples.
    """
    known = np.diagonal(ss, axis1=-2, axis2=-1)
    known = np.where(np.isfinite(known), known, 0.0)
    unit = np.where(known > 0, 1 / np.sqrt(np.where(known > 0, known, 1.0)), 0.0)
    # a diverging derivative gives no information
    ss, s = (np.nan_to_num(one, posinf=0.0, neginf=0.0) for one in (ss, s))
    scaled = ss * unit[..., :, None] * unit[..., None, :]
    scaled = scaled + damping[..., None, None] * np.eye(ss.shape[-1])
    inverse = np.linalg.pinv(scaled, rcond=_BLIND)
    return unit * np.einsum("rkab,rkb->rka", inverse, unit * s)


@program
def _ends(layout: Layout, pieces: Pieces, point: Point):
    """Return the state at the end of each piece, and the state that an impact at that
    time would produce.
    """
    substeps = jnp.max(pieces.substeps)

    def one(values, states, pieces):
        model = layout.at(values)
        size = states.shape[-1] - len(filtered_channels(model))
        part = pieces.flown
        ends = ends_of(model, pieces, states, substeps)
        times = part.start + part.step * part.place.shape[-2]

        def landed(t, x, drive):
            system = model.driven(t, drive)
            return jnp.concatenate([after_impact(system, t, x[:size]), x[size:]])

        last = DriveState(*(part[:, -1] for part in pieces.drive))
        hit = jax.vmap(landed)(times, ends, last)
        return ends, hit

    return jax.vmap(one)(point.values, point.states, with_begins(pieces, point))
