"""Predict the gains of hidden elements, for parameters on a grid.

A force that is a sum of known signals enters the likelihood like a vibration: states
and free parameters are eliminated, for many grid cells at once.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ...fitting import Problem
from ...fitting.engine import invert_information
from ..policy import Policy
from ..terms import ByMotion, DIRECT
from ._hidden_kinds import HYSTERESIS, Kind, RELAXATION, RESONANCE, STIFFENING
from ._hidden_signals import at_times, Driven
from ._hidden_state import Hidden
from ._local_force import forces_at_nodes, Response
from ._state_elimination import StateElimination, TINY
from ._vibration_scan import scanned_frequencies


# Damping ratios of the grid; the spacing of the frequencies is proportional to the
# width of a resonance
_RATIOS = (0.02, 0.1)
# Ratio of adjacent time constants of a relaxation
_TIMES = 1.25
# Limits of a hysteretic element, as fractions of the range of positions, and its other
# parameters
_LIMITS = tuple(np.geomspace(0.03, 1.5, 12).tolist())
_SHAPES = ((0.5, 1.0), (1.0, 1.0), (0.5, 2.0), (1.0, 2.0))
# The limits and other parameters of a stiffening hysteretic element
_STIFFENING_LIMITS = tuple(np.geomspace(0.1, 10, 12).tolist())
_STIFFENING_SHAPES = ((-0.3, 1.0), (-2.0, 1.0), (-0.3, 2.0), (-2.0, 2.0))
# Maximum number of force values at nodes that are computed at once
_AT_ONCE = 8_000_000
# Relative increase of a diagonal that keeps a matrix positive definite
_FORCES = 1e-9
# Minimum fraction of the information on a force that must remain when the other
# parameters are free
_ALIKE = 1e-8


class Promise(NamedTuple):
    """The predicted gain of an element in twice the log-likelihood, and the start of
    its fit.

    `direct`: strengths of the direct parts of the force.
    """

    gain: float
    hidden: Hidden
    direct: Float[np.ndarray, " d"]


def promises(
    problem: Problem, response: Response, driven: Driven, policy: Policy
) -> Iterator[Promise]:
    """Yield the best grid cell of each kind of element.

    **Arguments:** a problem with a slot for an element, and its `Response` about a fit.
    """
    chain = _Chain(problem, response, driven)
    for kind, cells in _grids(problem, driven, policy):
        best = None
        width = len(kind.outputs) + kind.starts
        count = max(1, _AT_ONCE // (response.time.size * width))
        for first in range(0, len(cells), count):
            some = cells[first : first + count]
            gains, numbers = chain.gains(kind, some)
            k = int(np.argmax(gains))
            if best is None or gains[k] > best[0]:
                best = gains[k], some[k], numbers[k]
        if best is None:
            continue
        grown, cell, (strengths, starts, direct) = best
        hidden = Hidden(
            kind,
            driven,
            tuple(cell),
            tuple(strengths.tolist()),
            starts,
            cells=len(cells),
        )
        yield Promise(float(grown), hidden, direct)


def _grids(problem: Problem, driven: Driven, policy: Policy):
    """Yield the kinds of elements, each with the sets of parameters to try (cells)."""
    frequency = scanned_frequencies(problem, policy)
    if len(frequency):
        low, high = frequency[0], frequency[-1]
        yield (
            RESONANCE,
            [
                (f, ratio)
                for ratio in _RATIOS
                for f in np.exp(np.arange(math.log(low), math.log(high), ratio))
            ],
        )
        # with a corner frequency outside this range, a relaxation would act like
        # damping or stiffness
        longest = 1 / (2 * math.pi * low)
        shortest = 1 / (2 * math.pi * high)
        count = max(2, math.ceil(math.log(longest / shortest) / math.log(_TIMES)))
        yield RELAXATION, [(t,) for t in np.geomspace(shortest, longest, count)]
    for kind, limits, shapes in (
        (HYSTERESIS, _LIMITS, _SHAPES),
        (STIFFENING, _STIFFENING_LIMITS, _STIFFENING_SHAPES),
    ):
        cells = [(x * driven.spread, *shape) for x in limits for shape in shapes]
        yield kind, cells


class _Chain:
    """The pieces of all recordings, prepared for forces given at their nodes.

    The direct parts of a force (a constant, and parts proportional to deflection and
    velocity) are among the free parameters.

    **Arguments:** the problem, its `Response` about a fit, and the position that drives
    elements.
    """

    def __init__(self, problem: Problem, response: Response, driven: Driven):
        self.response, self.driven = response, driven
        by_motion = ByMotion([0.0] * DIRECT, jnp.asarray(driven.middle))
        self.direct = forces_at_nodes(response, [by_motion])
        self.size = len(response.prior) + DIRECT

    def gains(self, kind: Kind, cells: Sequence[Sequence[float]]):
        """Return the gains of some cells, and for each cell the strengths, the initial
        states and the direct parts.
        """
        columns = list(_columns(kind, cells, self.driven, self.response))
        shared = len(kind.outputs)
        information = np.zeros((self.size, self.size))
        score = np.zeros(self.size)
        free = len(self.response.prior)
        information[:free, :free] = np.diag(self.response.prior)
        score[:free] = self.response.pull
        records = len(self.response.place)
        starts = kind.starts
        width = shared + records * starts
        number = len(cells)
        across = np.zeros((number, width, self.size))
        own = np.zeros((number, width, width))
        pull = np.zeros((number, width))
        for r, place in enumerate(self.response.place):
            sums = _summed(self.response, r, self.direct[r], columns[r], number)
            used = np.flatnonzero(place >= 0)
            m = len(place)
            extra = np.arange(self.direct.shape[-1])
            rows = np.concatenate([place[used], free + extra])
            local = np.concatenate([used, m + extra])
            information[np.ix_(rows, rows)] += sums.pp[np.ix_(local, local)]
            score[rows] += sums.p[local]
            mine = shared + r * starts + np.arange(starts)
            columns_of = np.concatenate([np.arange(shared), mine])
            across[:, columns_of[:, None], rows] += sums.pf[local].transpose(1, 2, 0)
            pull[:, columns_of] += sums.f
            own[:, columns_of[:, None], columns_of] += sums.ff
        return self._solved(kind, information, score, across, own, pull, free)

    def _solved(self, kind, information, score, across, own, pull, free):
        inside = invert_information(information)
        inside = np.where(np.isfinite(inside), inside, 0.0)
        taken = across @ inside
        left = pull - taken @ score
        matrix = own - taken @ np.swapaxes(across, 1, 2)
        diagonal = np.einsum("wii->wi", matrix)
        # a force that acts like the free parameters, or not at all, gets zero strength
        apart = diagonal > _ALIKE * np.einsum("wii->wi", own) + TINY
        scale = np.where(apart, 1 / np.sqrt(np.where(apart, diagonal, 1.0)), 0.0)
        matrix = matrix * scale[:, :, None] * scale[:, None, :]
        matrix = matrix + _FORCES * np.eye(matrix.shape[-1])
        solved = np.linalg.solve(matrix, (left * scale)[..., None])[..., 0]
        gains = np.sum(left * scale * solved, axis=-1)
        # the gain includes that of the direct parts
        base = score @ inside @ score
        few = invert_information(information[:free, :free])
        few = np.where(np.isfinite(few), few, 0.0)
        base = base - score[:free] @ few @ score[:free]
        found = []
        shared, starts = len(kind.outputs), kind.starts
        for k, strengths in enumerate(solved * scale):
            rest = inside @ (score - across[k].T @ strengths)
            own_starts = strengths[shared:].reshape(-1, starts)
            found.append((strengths[:shared], own_starts, rest[free:]))
        return gains + base, found


def _columns(kind: Kind, cells, driven: Driven, response: Response):
    """Return, for each recording, the forces at its nodes if all strengths are one,
    `(k, l, cells, p)`.
    """
    each = kind.signals(driven, cells)
    times = response.time
    whole = np.empty((*times.shape, len(cells), len(kind.outputs) + kind.starts))
    for c, (outputs, free) in enumerate(each):
        signal = np.concatenate([outputs, free], axis=-1)
        whole[..., c, :] = at_times(driven, signal, times)
    return whole


class _Sums:
    """Information and score of the parameters and of the forces of all grid cells, for
    one recording.

    `pp` and `p` are information and score of the parameters; `pf` `(m, cells, p)`
    couples the parameters to the forces; `f` `(cells, p)` and `ff` `(cells, p, p)` are
    score and information of the forces.
    """

    def __init__(self, m: int, cells: int, width: int):
        self.shape = cells, width
        self.pp, self.p = np.zeros((m, m)), np.zeros(m)
        self.pf = np.zeros((m, cells, width))
        self.f = np.zeros((cells, width))
        self.ff = np.zeros((cells, width, width))

    def add(self, direct, pushed, off, sign):
        """Add rows: their derivatives with respect to the parameters (`direct`) and the
        forces (`pushed`), and their residuals (`off`).
        """
        self.pp += sign * direct.T @ direct
        self.p += sign * direct.T @ off
        self.pf += sign * (direct.T @ pushed).reshape(-1, *self.shape)
        self.f += sign * (off @ pushed).reshape(self.shape)
        self.ff += sign * self.products(pushed, pushed)

    def products(self, left, right):
        """Return the products of the columns of each cell."""
        left = left.reshape(-1, *self.shape).transpose(1, 2, 0)
        right = right.reshape(-1, *self.shape).transpose(1, 0, 2)
        return left @ right


def _summed(response: Response, r: int, direct, columns, cells: int) -> _Sums:
    """Eliminate the states of one recording, from the first piece to the last."""
    found: Any = jax.tree.map(lambda part: part[r], response.pieces)
    n, m = found.later.shape[-1], response.place.shape[1]
    d = direct.shape[-1]
    sums = _Sums(m + d, cells, columns.shape[-1])
    states, forces_before, direct_before = StateElimination(sums.add), None, None
    for k in np.flatnonzero(response.exists[r]):
        forces = columns[k].reshape(columns.shape[1], -1)
        inner, slope = found.information[k], found.slope[k]
        l = slice(n + m, None)
        # treat the direct parts as parameters, in addition to those of the problem
        side = inner[:, l] @ direct[k]
        known = np.block(
            [
                [inner[: n + m, : n + m], side[: n + m]],
                [side[: n + m].T, direct[k].T @ side[l]],
            ]
        )
        pull = np.concatenate([slope[: n + m], direct[k].T @ slope[l]])
        shaken = inner[:, l] @ forces
        coupled = np.concatenate([shaken[: n + m], direct[k].T @ shaken[l]])
        sums.pp += known[n:, n:]
        sums.p += pull[n:]
        sums.pf += coupled[n:].reshape(-1, *sums.shape)
        sums.f += (slope[l] @ forces).reshape(sums.shape)
        sums.ff += sums.products(forces, shaken[l])
        here = [known[:n, :n], known[:n, n:], pull[:n], coupled[:n]]
        if forces_before is None:
            states.begin(here)
        else:
            earlier = found.earlier[k]
            by_parameters = earlier[:, n : n + m] + found.direct[k, :, :m]
            moved = np.concatenate(
                [by_parameters, earlier[:, l] @ direct_before], axis=1
            )
            rows = moved, -found.tied[k], earlier[:, l] @ forces_before
            states.follow(here, earlier[:, :n], found.later[k], rows)
        forces_before, direct_before = forces, direct[k]
    states.end()
    return sums
