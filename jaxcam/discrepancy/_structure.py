"""What a fit leaves over: shapes that would still gain, and where they live."""

import dataclasses
import math
from collections.abc import Sequence

import jax
import numpy as np
from jaxtyping import Float
from scipy.stats import chi2, norm

from ..fitting import Fit, Problem, residuals
from ._engine import added, Blocks, blocks_of, extended, foretold, off
from ._local_force import force_blocks, Response
from ._shapes import Harmonics, Polynomial, Shape, shapes
from ._term import Term, terms_of
from ._trials import BEYOND, FALSE_ALARMS
from ._vibration_scan import Periodogram


_SHAPELESS = "coloured_residuals"
_LAGS = 20
# Stretches of each record, the worst of which does not count
_STRETCHES = 4
_POINTS = 48


@dataclasses.dataclass(frozen=True)
class Structure:
    """One way in which what is left over might not be noise.

    - `gain`: growth of twice the log-likelihood; `asked`: what chance and the number of
        parameters would demand.
    - `foretold`: growth in half of the records with what the other half says, where
        that was asked; negative for what differs from record to record.
    - `variable`, `grid`, `value`, `stderr` `(k,)`: the shape, where there is one.
    """

    name: str
    sentence: str
    where: str
    region: str
    gain: float
    asked: float
    count: int
    unit: str = ""
    variable: str = ""
    grid: Float[np.ndarray, " k"] = dataclasses.field(
        default_factory=lambda: np.zeros(0)
    )
    value: Float[np.ndarray, " k"] = dataclasses.field(
        default_factory=lambda: np.zeros(0)
    )
    stderr: Float[np.ndarray, " k"] = dataclasses.field(
        default_factory=lambda: np.zeros(0)
    )

    foretold: float = math.inf

    @property
    def significant(self) -> bool:
        return self.gain > self.asked and self.foretold > 0

    @property
    def place(self) -> str:
        """Where the shape is largest in units of its error."""
        if not len(self.grid):
            return self.region
        score = np.abs(self.value) / np.maximum(self.stderr, 1e-300)
        k = int(np.argmax(score))
        return (
            f"{self.region}; clearest at {self.variable} {self.grid[k]:.3g}, where it "
            f"is {self.value[k]:.2g} +- {self.stderr[k]:.1g} {self.unit}"
        )


def structures(
    found: Fit,
    response: Response,
    unlisted: Sequence[Term],
    scan: Periodogram,
    turned: bool,
) -> list[Structure]:
    """Everything that the residuals of a fit are asked for, largest excess first.

    **Arguments:** the fit, what a force would gain beside it, terms that describe but
    are no verdicts, the periodogram of what is left, and whether there is a drive.
    """
    problem = found.problem
    more: tuple[Term, ...] = (*unlisted, *shapes(*_ranges(problem), turned=turned))
    # a force needs no program of its own
    forces = [t for t in more if t.acts == ("flight",)]
    others = [t for t in more if t.acts != ("flight",)]
    wide = extended(problem, others, found.point)
    tests = len(more) + 2
    made = []
    for terms, blocks, place in (
        (forces, force_blocks(problem, response, forces), 0),
        (others, blocks_of(wide, wide.start), len(terms_of(problem.model))),
    ):
        information, score = blocks.total()
        free = blocks.rows(response.free)
        for k, term in enumerate(terms):
            own = blocks.rows([p.name for p in term.parameters(place + k)])
            grown = added(information, score, free, own)
            asked = _asked(len(own), problem.samples, tests)
            shape = _shape(term, blocks, information, score, free, own)
            made.append(
                Structure(
                    term.name,
                    term.sentence,
                    term.where,
                    term.region,
                    grown,
                    asked,
                    len(own),
                    **shape,
                    foretold=foretold(blocks, free, own) if grown > asked else math.inf,
                )
            )
    made += [_vibration(scan, problem, tests), _coloured(found, tests)]
    # a shape says more than that there is one
    return sorted(
        made,
        key=lambda one: (
            one.significant and one.name != _SHAPELESS,
            one.gain - one.asked,
        ),
        reverse=True,
    )


def _shape(term: Term, blocks: Blocks, information, score, free, own) -> dict:
    """What a shape looks like, once it is fitted."""
    if not isinstance(term, Shape):
        return {}
    both = np.union1d(free, own)
    step, covariance = off(information, score, both)
    pick = np.searchsorted(both, own)
    scale = blocks.scale[own]
    covariance = covariance[np.ix_(pick, pick)]
    if not np.isfinite(covariance).all():
        return {}
    return _function(term, step[pick] * scale, covariance, scale)


def _asked(count: int, samples: int, tests: int, looks: int = 1) -> float:
    chance = FALSE_ALARMS / tests / looks
    least = max(count * math.log(samples), float(chi2.isf(chance, count)))
    # as sure as a term that is named
    return (math.sqrt(least) + BEYOND) ** 2


def _function(term: Shape, coefficients, covariance, scale):
    if isinstance(term, Polynomial):
        grid = np.linspace(float(term.low), float(term.high), _POINTS)
    else:
        assert isinstance(term, Harmonics)
        grid = np.linspace(0.0, 2 * np.pi, _POINTS)
    basis = np.asarray(jax.vmap(term.basis)(grid))
    spread = basis * scale
    error = np.sqrt(np.maximum(np.einsum("kp,pq,kq->k", spread, covariance, spread), 0))
    return {
        "unit": term.unit,
        "variable": term.variable,
        "grid": grid,
        "value": basis @ coefficients,
        "stderr": error,
    }


def _vibration(scan: Periodogram, problem: Problem, tests: int) -> Structure:
    frequency, grown = scan.best_separate
    count = 2 * scan.records + 1
    seen = math.inf
    if scan.records > 1:
        # a frequency that one record suggests must be seen in the others
        chance = chi2.isf(FALSE_ALARMS, 2 * (scan.records - 1))
        seen = scan.elsewhere - float(chance)
    return Structure(
        "resonance",
        f"a force at {frequency:.4g} Hz with a phase of its own in each record",
        "flight",
        f"in flight, at {frequency:.4g} Hz",
        grown,
        _asked(count, problem.samples, tests, scan.cells),
        count,
        foretold=seen,
    )


def _coloured(found: Fit, tests: int) -> Structure:
    """Whether residuals that are close in time are alike, not in one stretch alone."""
    totals, counts, cost = [], [], 0.0
    for part in residuals(found):
        value = part.value / part.noise
        cost += float(np.sum(value**2))
        for stretch in np.array_split(np.arange(len(value)), _STRETCHES):
            total, count = 0.0, 0
            for lag in range(1, _LAGS + 1):
                a, b = stretch[lag:], stretch[:-lag]
                same = (part.flight[a] == part.flight[b]) & (
                    part.resting[a] == part.resting[b]
                )
                total += float(np.sum((value[a] * value[b])[same]))
                count += int(np.sum(same))
            totals.append(total)
            counts.append(count)
    worst = int(np.argmax(totals))
    total, count = np.sum(totals) - totals[worst], np.sum(counts) - counts[worst]
    score = float(total) / math.sqrt(max(int(count), 1))
    bic = math.log(found.problem.samples)
    # as the gain of one parameter, with the smoothness that states take out ignored
    return Structure(
        _SHAPELESS,
        "a smooth motion of a form that no shape has",
        "flight",
        "in flight and at rest",
        # no motion gains more than what is left over
        min(max(score, 0.0) ** 2, cost),
        (math.sqrt(max(float(norm.isf(FALSE_ALARMS / tests)) ** 2, bic)) + BEYOND) ** 2,
        1,
    )


def _ranges(problem: Problem):
    """Least and largest position, velocity and approach speed, and the duration."""
    states = np.asarray(problem.start.states)[np.asarray(problem.pieces.exists)]
    position, velocity = states[:, 0], states[:, 1]
    position = np.concatenate(
        [part.recording[part.channel] for part in problem.segments]
    )
    speeds = np.concatenate([part.impacts.approach for part in problem.segments])
    speeds = speeds[np.isfinite(speeds) & (speeds > 0)]
    top = float(np.max(speeds, initial=1e-3))
    return (
        (float(position.min()), float(position.max())),
        (float(np.quantile(velocity, 0.005)), float(np.quantile(velocity, 0.995))),
        (0.0, top),
        max(part.recording.duration for part in problem.segments),
    )
