"""Fit subsets of terms, and predict the gain of further terms from each fit."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from scipy.stats import chi2

from ...fitting import Fit, fit, Problem
from ...fitting.engine import nominal_of, Point
from ..policy import Policy
from ..terms import Term
from ._blocks import Blocks, blocks_of
from ._clock import Clock
from ._gains import predicted_gain
from ._given_up import given_up
from ._kept_trials import Ended, KeptTrials
from ._local_force import force_response, Response
from ._placing import Placing, placing
from ._vibration_scan import Periodogram, periodogram


@dataclasses.dataclass(frozen=True)
class Trial:
    """A fitted subset of terms; `cut` if the fit ended only because of the limit on
    iterations.
    """

    names: frozenset[str]
    fit: Fit
    bic: float
    count: int
    cut: bool


class Trials:
    """All fits of one problem, and the predictions from them.

    **Arguments:** the problem, the names of the rig parameters (free in every fit), the
    candidate terms, the policy, `progress(sentence, fraction)`, the store of fits for
    an interrupted run, and the clock that limits the time.
    """

    def __init__(
        self,
        problem: Problem,
        rig: Sequence[str],
        terms: Sequence[Term],
        policy: Policy,
        progress: Callable[[str, float | None], None],
        kept: KeptTrials | None = None,
        clock: Clock | None = None,
    ):
        self.problem, self.rig, self.terms = problem, tuple(rig), tuple(terms)
        self.policy, self.progress = policy, progress
        self.clock = clock or Clock(policy.minutes)
        # the best fit of each subset
        self.known: dict[frozenset[str], Trial] = {}
        self._kept = kept
        self._scans: dict[frozenset[str], Periodogram] = {}
        self._responses: dict[frozenset[str], Response] = {}
        self._linear: dict[frozenset[str], Blocks] = {}
        self._placed: dict[tuple[frozenset[str], str], Placing] = {}

    @property
    def least_cost(self) -> float:
        """Smallest cost of all fits so far; infinite if there is none."""
        return min((trial.fit.cost for trial in self.known.values()), default=math.inf)

    def hopeless(self, cost: float) -> bool:
        """Return whether a fit with this cost is too far from the best to refine it."""
        return cost > self.policy.hopeless_cost * self.least_cost

    def term(self, name: str) -> Term:
        return next(term for term in self.terms if term.name == name)

    def parameters(self, names: Iterable[str]) -> list[str]:
        """Return the parameters of the rig and of the given terms."""
        found = list(self.rig)
        for term in self.terms:
            if term.name in names:
                found += [one.name for one in term.strengths()]
        return found

    def count(self, names: Iterable[str]) -> int:
        return len(self.parameters(names)) - len(self.rig)

    def threshold(self, name: str) -> float:
        """Return the required gain of a term: the larger of those from the BIC and from
        the error rate.
        """
        term = self.term(name)
        number, chance = self.count([name]), self.policy.false_alarms / len(self.terms)
        if term.starts():
            chance /= len(term.starts())
        elif any(one.inner for one in term.strengths()):
            # one test per distinguishable frequency
            chance /= self.scan(frozenset()).cells
        level = float(chi2.isf(chance, number))
        return max(number * math.log(self.problem.samples), level)

    def attempt(
        self, names: frozenset[str], start: Trial | None, iterations: int | None = None
    ) -> Trial | None:
        """Fit a subset, starting from another fit, and return the best fit of the
        subset so far.

        **Arguments:** `iterations`: maximum number; default: that of a first fit.
        """
        iterations = iterations or self.policy.quick_iterations
        found = self._left(names) or self._fitted(names, start, iterations)
        if not math.isfinite(found.cost):
            return None
        count = self.count(names)
        bic = found.cost + count * math.log(self.problem.samples)
        cut = not found.optimal and found.iterations == iterations
        trial = Trial(names, found, bic, count, cut)
        before = self.known.get(names)
        if before is None or _order(trial) < _order(before):
            self.known[names] = trial
            if self._kept is not None:
                ended = Ended(found.point, found.optimal, found.iterations)
                self._kept.put(names, ended)
            # predictions from the earlier fit are no longer valid
            for derived in (self._scans, self._responses, self._linear):
                derived.pop(names, None)
            for key in [key for key in self._placed if key[0] == names]:
                del self._placed[key]
        return self.known[names]

    def _left(self, names: frozenset[str]) -> Fit | None:
        """Return the fit of a subset stored by an interrupted run."""
        if self._kept is None or names in self.known:
            return None
        ended = self._kept.get(names)
        if ended is None:
            return None
        free = self.parameters(names)
        found = fit(self.problem, free=free, start=ended.point, iterations=0)
        return dataclasses.replace(
            found, optimal=ended.converged, iterations=ended.iterations
        )

    def _fitted(
        self, names: frozenset[str], start: Trial | None, iterations: int
    ) -> Fit:
        """Fit from one starting point, and from another one if that fails.

        A fit without the right term may end in a long valley of the cost, far from the
        nominal rig. The nominal parameters are then a better starting point.
        """
        free = self.parameters(names)
        if start is None:
            return self._fit(free, self.problem.start, iterations)
        ended = self._seeded(names, start, start.fit.point)
        if names == start.names:
            return self._fit(free, ended, iterations)
        nominal = self._seeded(names, start, self.problem.start)
        astray = not self._sound(start.fit)
        first, second = (nominal, ended) if astray else (ended, nominal)
        grown = names > start.names
        # fits of single terms decide which pairs are tried, so they continue longer
        beaten = start.fit.cost if grown and len(names) > 1 else math.inf
        # the loss without a term must be accurate if it decides whether the term stays
        decides = -math.inf
        if names < start.names:
            threshold = sum(self.threshold(name) for name in start.names - names)
            decides = start.fit.cost + self.policy.clear_gain * threshold
        found = self._fit(free, first, iterations, beaten, decides)
        if self._sound(found) or self.hopeless(found.cost):
            return found
        if astray and grown and found.cost < start.fit.cost:
            # the fit restarted from the nominal rig is better than the smaller subset
            return found
        again = self._fit(free, second, iterations, found.cost, decides)
        return min(found, again, key=_cost)

    def _fit(
        self,
        free: Sequence[str],
        start: Point,
        iterations: int,
        beaten: float = math.inf,
        decides: float = -math.inf,
    ) -> Fit:
        stop = given_up(self.problem.samples, self.policy, beaten, decides)
        return fit(
            self.problem, free=free, start=start, iterations=iterations, stop=stop
        )

    def finished(self, trial: Trial) -> Trial:
        """Complete the fit of a leading subset."""
        if not trial.cut:
            return trial
        return self.attempt(trial.names, trial, self.policy.iterations) or trial

    def settled(self, trial: Trial) -> bool:
        """Return whether the quadratic model about a fit is valid.

        It is valid at an optimum, and also elsewhere if the fit is not poor.
        """
        close = trial.fit.cost < self.policy.near_cost * self.problem.samples
        return trial.fit.optimal or close

    def without(self, best: Trial, name: str) -> Trial:
        """Return the fit of a subset without one of its terms."""
        rest = best.names - {name}
        known = self.known.get(rest) or self.attempt(rest, best, self.policy.iterations)
        assert known is not None
        return known

    def blocks(self, trial: Trial) -> Blocks:
        if trial.names not in self._linear:
            self._linear[trial.names] = blocks_of(self.problem, trial.fit.point)
        return self._linear[trial.names]

    def foretells(self, less: Trial, more: Trial) -> bool:
        """Return whether the additional terms of a fit are consistent across
        recordings.

        The strengths estimated from either half of the recordings are tested on the
        other half.
        """
        blocks = self.blocks(less)
        added = [
            one.name
            for name in more.names - less.names
            for one in self.term(name).strengths()
            if not one.inner
        ]
        free = blocks.rows(self.parameters(less.names))
        return predicted_gain(blocks, free, blocks.rows(added), self.policy) > 0

    def response(self, names: frozenset[str]) -> Response:
        """Return the response to forces at all nodes, linearised about a fit."""
        if names not in self._responses:
            point = self.known[names].fit.point
            free = self.parameters(names)
            self._responses[names] = force_response(self.problem, point, free)
        return self._responses[names]

    def scan(self, names: frozenset[str]) -> Periodogram:
        """Return the periodogram of the residual of a fit."""
        if names not in self._scans:
            self.progress("searching for vibrations", None)
            self._scans[names] = periodogram(
                self.problem, self.response(names), self.policy
            )
        return self._scans[names]

    def placed(self, names: frozenset[str], term: Term) -> Placing:
        """Return the starting values with which a term added to a fit gains most."""
        key = names, term.name
        if key not in self._placed:
            self.progress(f"searching for the position of {term.sentence}", None)
            self._placed[key] = placing(
                self.problem, self.response(names), term, self.policy
            )
        return self._placed[key]

    def _inner(self, term: Term, name: str, start: Trial) -> float:
        """Return the initial value of an inner parameter of a new term."""
        if term.starts():
            return self.placed(start.names, term).inner[name]
        return self._frequency(start)

    def _frequency(self, start: Trial) -> float:
        """Return the frequency at which a vibration is predicted to gain most."""
        known = self._scans.get(start.names) or next(iter(self._scans.values()), None)
        scan = known or self.scan(start.names)
        return scan.best[0]

    def _sound(self, found: Fit) -> bool:
        """Return whether a fit converged within a few tolerances of the nominal rig."""
        if not found.optimal:
            return False
        for name in self.rig:
            known = self.problem.parameter(name).prior_stderr
            nominal = nominal_of(self.problem, self.problem.names.index(name))
            if abs(found[name].value - nominal) > self.policy.astray_shift * known:
                return False
        return True

    def _seeded(self, names: frozenset[str], start: Trial, place: Point) -> Point:
        """Return a starting point for a subset; new terms have zero strength."""
        values = np.array(place.values)
        everything = self.problem.names
        for term in self.terms:
            for one in term.strengths():
                column = everything.index(one.name)
                if one.inner and term.name in names - start.names:
                    values[:, column] = self._inner(term, one.name, start)
                elif one.inner:
                    values[:, column] = start.fit.point.values[:, column]
                elif term.name not in names:
                    values[:, column] = 0.0
        return place._replace(values=values)


def _order(trial: Trial) -> tuple[float, bool]:
    """Return the sort key of a fit: the smaller BIC is better; among equals, an optimum
    is better.
    """
    return trial.bic, not trial.fit.optimal


def _cost(found: Fit) -> float:
    return found.cost if math.isfinite(found.cost) else math.inf
