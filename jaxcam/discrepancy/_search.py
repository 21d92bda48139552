"""The best subset of up to three terms, each judged by a fit of whole trajectories."""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from scipy.stats import chi2, norm

from ..fitting import Fit, fit, Problem
from ..fitting._linearise import Point
from ._engine import added, Blocks, blocks_of, gain
from ._kept_trials import KeptTrials
from ._local_force import force_response, Response
from ._term import Term
from ._vibration_scan import Periodogram, periodogram


#: chance that any term at all is named where nothing is missing
FALSE_ALARMS = 0.01
#: part of the redrawn sets of stretches in which what is named must be kept, and how
#: many standard errors beyond what is asked it then is, where all is as it should be
SURE = 0.9
BEYOND = float(norm.ppf(SURE))
MOST_TERMS = 3
# How many of the best subsets of each size are built upon, and how many are tried
_KEPT, _TRIED = 3, 6
# Iterations of a first look at a subset, and at most of one that may win
_QUICK, _ITERATIONS = 15, 60
# Subsets within this BIC of the best one may lead to a better one than it does
_RIVAL = 50.0
# Cost a sample, one where nothing but noise is left, of a fit that explains the data
_EXPLAINED = 1.2
# Standard deviations of what is known of a rig beyond which its fit went astray
_FAR = 3.0


@dataclasses.dataclass(frozen=True)
class Trial:
    """A subset of terms, fitted."""

    names: frozenset[str]
    fit: Fit
    bic: float
    count: int


class Search:
    """All that was tried on one problem.

    **Arguments:** the problem, the names of the parameters of the rig (free in every
    fit), the terms that may be named, `progress(sentence, fraction)`, and where fits
    are kept for a run that is interrupted.
    """

    def __init__(
        self,
        problem: Problem,
        rig: Sequence[str],
        terms: Sequence[Term],
        progress: Callable[[str, float | None], None],
        kept: KeptTrials | None = None,
    ):
        self.kept = kept
        self.problem, self.rig, self.terms = problem, tuple(rig), tuple(terms)
        self.progress = progress
        self.trials: dict[frozenset[str], Trial] = {}
        self.scans: dict[frozenset[str], Periodogram] = {}
        self.responses: dict[frozenset[str], Response] = {}
        self.linear: dict[frozenset[str], Blocks] = {}

    def term(self, name: str) -> Term:
        return next(term for term in self.terms if term.name == name)

    def parameters(self, names: Iterable[str]) -> list[str]:
        """Parameters of the rig and of some terms."""
        found = list(self.rig)
        for term in self.terms:
            if term.name in names:
                found += [one.name for one in term.strengths()]
        return found

    def count(self, names: Iterable[str]) -> int:
        return len(self.parameters(names)) - len(self.rig)

    def asked(self, name: str) -> float:
        """Gain that a term must have: the more demanding of BIC and error rate."""
        term = self.term(name)
        number, chance = self.count([name]), FALSE_ALARMS / len(self.terms)
        if any(one.inner for one in term.strengths()):
            # as many chances as there are frequencies
            chance /= self.scan(frozenset()).cells
        level = float(chi2.isf(chance, number))
        return max(number * math.log(self.problem.samples), level)

    def run(self) -> Trial:
        """The best subset; empty where no term is worth its parameters."""
        best = self._attempt(frozenset(), None, _ITERATIONS)
        assert best is not None
        kept = [best]
        for size in range(1, MOST_TERMS + 1):
            promised = self._promised(kept, best)
            most = len(self.terms) if size == 1 else _TRIED
            order = sorted(promised, key=lambda n: promised[n][0])[:most]
            for k, names in enumerate(order):
                said = " and ".join(sorted(names)).replace("_", " ")
                self.progress(f"fitting {said}", k / len(order))
                start = promised[names][1]
                if self._settles(start, self._attempt(names, start)):
                    break
            found = [t for n, t in self.trials.items() if len(n) == size]
            lowest = min((t.fit.cost for t in self.trials.values()), default=math.inf)
            kept = sorted(found, key=_bic)[:_KEPT]
            kept = [self._finished(t) if t.fit.cost < 2 * lowest else t for t in kept]
            kept = sorted((t for t in kept if t.bic < best.bic), key=_bic)
            if not kept:
                break
            best = self._better(best, kept[0])
        return self._swapped(self._smallest(best))

    def _settles(self, start: Trial, trial: Trial | None) -> bool:
        """Whether a subset explains what the one that promised it could not.

        What the other one promises of further subsets is then worth little; this one's
        own quadratic model tells which of them are as good, and these are fitted.
        """
        enough = _EXPLAINED * self.problem.samples
        if trial is None or not trial.fit.cost < enough < start.fit.cost:
            return False
        for names in self._exchanges(trial, _RIVAL):
            self._attempt(names, trial)
        return True

    def _promised(
        self, kept: Sequence[Trial], best: Trial
    ) -> dict[frozenset[str], tuple[float, Trial]]:
        """Subsets with one term more than those kept: the BIC promised, and by whom."""
        promised: dict[frozenset[str], tuple[float, Trial]] = {}
        # what the best subset lacks, its own scores know best
        own = self._promises(best, self.scan(best.names))
        for trial in kept:
            # where the best one lacks nothing, only its equals can lead further
            if not own and trial.bic > best.bic + _RIVAL:
                continue
            for names, bic in self._promises(trial, self.scan(best.names)).items():
                if names > best.names and names not in own:
                    continue
                if names not in promised or bic < promised[names][0]:
                    promised[names] = bic, trial
        return promised

    def _smallest(self, best: Trial) -> Trial:
        """Terms that the others can do without, by the error rate too, are dropped."""
        for name in sorted(best.names):
            # the same place with one term less: a fit of its own may have gone astray
            self._attempt(best.names - {name}, best, _ITERATIONS)
        for size in range(len(best.names)):
            enough = []
            for names in itertools.combinations(sorted(best.names), size):
                less = self.trials.get(frozenset(names))
                if less is None:
                    continue
                asked = sum(self.asked(name) for name in best.names - less.names)
                if less.fit.cost - best.fit.cost < asked:
                    enough.append(less)
            if enough:
                return min(enough, key=lambda trial: trial.bic)
        return best

    def without(self, best: Trial, name: str) -> Trial:
        """The fit of a subset with one term less."""
        rest = best.names - {name}
        known = self.trials.get(rest) or self._attempt(rest, best, _ITERATIONS)
        assert known is not None
        return known

    def _better(self, best: Trial, other: Trial) -> Trial:
        return other if other.bic < best.bic else best

    def _swapped(self, best: Trial) -> Trial:
        """Subsets with one term exchanged, as far as the quadratic model favours it."""
        for _ in range(MOST_TERMS):
            if not best.names:
                return best
            found = best
            for names in self._exchanges(best):
                if names in self.trials:
                    continue
                trial = self._attempt(names, best)
                if trial is not None:
                    found = self._better(found, trial)
            if found is best:
                return best
            best = self._smallest(found)
        return best

    def _exchanges(self, best: Trial, worse: float = 0.0) -> list[frozenset[str]]:
        """Subsets that the quadratic model about the best fit finds as good, or `worse`
        by that much BIC at most."""
        blocks = self.blocks(best)
        information, score = blocks.total()
        free = blocks.rows(self.parameters(best.names))
        value = values_of(best.fit, blocks)
        top = gain(information, score, free)
        found = []
        for out in best.names:
            gone = blocks.rows([one.name for one in self.term(out).strengths()])
            rest = np.setdiff1d(free, gone)
            step = np.zeros(len(blocks.names))
            step[gone] = -value[gone]
            cost = step @ information @ step - 2 * step @ score
            moved = score - information @ step
            for term in self.terms:
                if term.name in best.names:
                    continue
                new = [one.name for one in term.strengths() if not one.inner]
                rows = np.union1d(rest, blocks.rows(new))
                change = top + cost - gain(information, moved, rows)
                extra = self.count([term.name]) - self.count([out])
                if change + extra * math.log(self.problem.samples) < worse:
                    found.append((best.names - {out}) | {term.name})
        return found[:_TRIED]

    def _promises(self, trial: Trial, scan: Periodogram) -> dict[frozenset[str], float]:
        """What the scores say of each further term: the BIC it would lead to."""
        blocks = self.blocks(trial)
        information, score = blocks.total()
        free = blocks.rows(self.parameters(trial.names))
        found = {}
        for term in self.terms:
            if term.name in trial.names:
                continue
            names = [one.name for one in term.strengths() if not one.inner]
            grown = added(information, score, free, blocks.rows(names))
            if any(one.inner for one in term.strengths()):
                grown = max(grown, scan.best[1])
            if grown < self.asked(term.name):
                continue
            cost = trial.fit.cost - grown
            count = trial.count + self.count([term.name])
            bic = cost + count * math.log(self.problem.samples)
            found[trial.names | {term.name}] = bic
        return found

    def blocks(self, trial: Trial) -> Blocks:
        if trial.names not in self.linear:
            self.linear[trial.names] = blocks_of(self.problem, trial.fit.point)
        return self.linear[trial.names]

    def response(self, names: frozenset[str]) -> Response:
        """What a force at any time would gain beside a fit."""
        if names not in self.responses:
            point = self.trials[names].fit.point
            free = self.parameters(names)
            self.responses[names] = force_response(self.problem, point, free)
        return self.responses[names]

    def scan(self, names: frozenset[str]) -> Periodogram:
        """Periodogram of what a fit leaves over."""
        if names not in self.scans:
            self.progress("looking for vibrations", None)
            self.scans[names] = periodogram(self.problem, self.response(names))
        return self.scans[names]

    def _frequency(self, start: Trial) -> float:
        """The best known frequency to start from."""
        known = self.scans.get(start.names) or next(iter(self.scans.values()), None)
        scan = known or self.scan(start.names)
        return scan.best[0]

    def _attempt(
        self, names: frozenset[str], start: Trial | None, iterations: int = _QUICK
    ) -> Trial | None:
        """Fit a subset from where another one ended.

        A fit without the right term may end far from the rig, in a valley that leads
        nowhere. Then the nominal parameters are a better place to start from.
        """
        free, places = self.parameters(names), [self.problem.start]
        if start is not None:
            ended = self._seeded(names, start, start.fit.point)
            nominal = self._seeded(names, start, self.problem.start)
            places = [ended, nominal] if self._sound(start.fit) else [nominal, ended]
        known = self.kept.get(names) if self.kept is not None else None
        if known is not None and names not in self.trials:
            places.insert(0, known)
        found = fit(self.problem, free=free, start=places[0], iterations=iterations)
        least = min((t.fit.cost for t in self.trials.values()), default=math.inf)
        for place in places[1:]:
            if self._sound(found) or found.cost > 2 * least:
                break
            again = fit(self.problem, free=free, start=place, iterations=iterations)
            found = min(found, again, key=_cost)
        if not math.isfinite(found.cost):
            return None
        count = self.count(names)
        bic = found.cost + count * math.log(self.problem.samples)
        trial = Trial(names, found, bic, count)
        if names not in self.trials or bic < self.trials[names].bic:
            self.trials[names] = trial
            if self.kept is not None:
                self.kept.put(names, found.point)
            # what was said about the fit before holds no more
            for known in (self.scans, self.responses, self.linear):
                known.pop(names, None)
        return self.trials[names]

    def _finished(self, trial: Trial) -> Trial:
        """A subset that may win is fitted to the end."""
        if trial.fit.converged:
            return trial
        return self._attempt(trial.names, trial, _ITERATIONS) or trial

    def _sound(self, found: Fit) -> bool:
        """Whether a fit ended, and within a few tolerances of what the rig is."""
        if not found.converged:
            return False
        start = np.asarray(self.problem.start.values)[0]
        for name in self.rig:
            known = self.problem.parameter(name).prior_stderr
            nominal = start[self.problem.names.index(name)]
            if abs(found[name].value - nominal) > _FAR * known:
                return False
        return True

    def _seeded(self, names: frozenset[str], start: Trial, place: Point) -> Point:
        """A place to start from; terms that another fit lacks are without effect."""
        values = np.array(place.values)
        everything = self.problem.names
        for term in self.terms:
            for one in term.strengths():
                column = everything.index(one.name)
                if one.inner and term.name in names - start.names:
                    values[:, column] = self._frequency(start)
                elif one.inner:
                    values[:, column] = start.fit.point.values[:, column]
                elif term.name not in names:
                    values[:, column] = 0.0
        return place._replace(values=values)


def _bic(trial: Trial) -> float:
    return trial.bic


def _cost(found: Fit) -> float:
    return found.cost if math.isfinite(found.cost) else math.inf


def values_of(found: Fit, blocks: Blocks) -> np.ndarray:
    """Values of the parameters of some blocks at a fit, in their scales."""
    all_names = found.problem.names
    columns = [all_names.index(name) for name in blocks.names]
    return np.asarray(found.point.values)[0, columns] / blocks.scale
