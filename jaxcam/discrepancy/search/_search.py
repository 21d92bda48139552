"""Search for the best subset of terms by fits of whole trajectories."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from ..terms import spelled
from ._blocks import values_of
from ._gains import added_gain, gain
from ._trials import Trial, Trials
from ._vibration_scan import Periodogram


class Search:
    """A search over subsets of terms that keeps several good ones of each size."""

    def __init__(self, trials: Trials):
        self.trials, self.policy = trials, trials.policy

    def run(self) -> Trial:
        """Return the best subset; it is empty if no term is worth its parameters.

        It is also empty if the best fit is poor, has not converged and explains too
        little of the misfit: being the best of several poor fits is not evidence.
        """
        bare = self.trials.attempt(frozenset(), None, self.policy.iterations)
        assert bare is not None
        best, kept = bare, [bare]
        for size in range(1, self.policy.most_terms + 1):
            promised = self._promised(kept, best)
            most = len(self.trials.terms) if size == 1 else self.policy.fitted_subsets
            order = sorted(promised, key=lambda n: promised[n][0])[:most]
            for k, names in enumerate(order):
                if self._late():
                    break
                said = " and ".join(spelled(name) for name in sorted(names))
                self.trials.progress(f"fitting {said}", k / len(order))
                start = promised[names][1]
                if self._settles(start, self.trials.attempt(names, start)):
                    break
            found = [t for n, t in self.trials.known.items() if len(n) == size]
            enough = self.policy.hopeless_cost * self.trials.least_cost
            kept = sorted(found, key=_bic)[: self.policy.extended_subsets]
            kept = [self.trials.finished(t) if t.fit.cost < enough else t for t in kept]
            kept = sorted((t for t in kept if t.bic < best.bic), key=_bic)
            if not kept:
                break
            before, best = best, self._better(best, kept[0])
            if not self._leads(before, best):
                break
        if self.trials.settled(best):
            return self.refined(best)
        if best.fit.cost < self.policy.explains * bare.fit.cost:
            return best
        return self._sound(bare)

    def refined(self, best: Trial) -> Trial:
        """Return the best subset without terms that are not needed, and after exchanges
        of single terms.
        """
        return self._swapped(self._smallest(best))

    def _sound(self, bare: Trial) -> Trial:
        """Return the best of the subsets whose quadratic models are valid.

        A subset whose fit fails must not hide one whose fit succeeds.
        """
        sound = [one for one in self.trials.known.values() if self.trials.settled(one)]
        best = min(sound, key=_bic, default=bare)
        if not best.names or best.bic >= bare.bic:
            return bare
        return self._swapped(self._smallest(best))

    def _leads(self, before: Trial, best: Trial) -> bool:
        """Return whether to continue the search.

        If the fit is poor, the search continues only if the added terms have reduced
        the cost substantially.
        """
        part = best.fit.cost / before.fit.cost
        return self.trials.settled(best) or part < self.policy.helpful_cost

    def _late(self) -> bool:
        """Return whether to try no further subset.

        While the fit is poor, time is left for unnamed functions, because the terms may
        not contain the missing effect.
        """
        near = self.policy.near_cost * self.trials.problem.samples
        far = self.trials.least_cost > near
        return self.trials.clock.past(self.policy.named_time if far else 1.0)

    def _settles(self, start: Trial, trial: Trial | None) -> bool:
        """Return whether a subset explains the data although the smaller one did not.

        The predictions of the smaller subset are then unreliable. The quadratic model
        of the larger subset determines which others are equally good; these are fitted.
        """
        enough = self.policy.explained * self.trials.problem.samples
        if trial is None or not trial.fit.cost < enough < start.fit.cost:
            return False
        for names in self._exchanges(trial, self.policy.lead_bic):
            self.trials.attempt(names, trial)
        return True

    def _promised(
        self, kept: Sequence[Trial], best: Trial
    ) -> dict[frozenset[str], tuple[float, Trial]]:
        """Return the subsets with one term more than those kept, each with its
        predicted BIC and the smaller subset from which the BIC is predicted.
        """
        promised: dict[frozenset[str], tuple[float, Trial]] = {}
        # scores at the best subset are most reliable
        own = self._promises(best, self.trials.scan(best.names))
        for trial in kept:
            # if the best subset leaves only noise, only equally good ones are extended
            if not own and trial.bic > best.bic + self.policy.lead_bic:
                continue
            for names, bic in self._promises(
                trial, self.trials.scan(best.names)
            ).items():
                if names > best.names and names not in own:
                    continue
                if names not in promised or bic < promised[names][0]:
                    promised[names] = bic, trial
        return promised

    def _smallest(self, best: Trial) -> Trial:
        """Drop terms that are not needed according to the error rate and the BIC."""
        for name in sorted(best.names):
            # refit the smaller subset from here, because its own fit may have failed
            self.trials.attempt(best.names - {name}, best, self.policy.iterations)
        for size in range(len(best.names)):
            enough = []
            for names in itertools.combinations(sorted(best.names), size):
                less = self.trials.known.get(frozenset(names))
                if less is None:
                    continue
                threshold = sum(
                    self.trials.threshold(name) for name in best.names - less.names
                )
                if less.fit.cost - best.fit.cost < threshold:
                    enough.append(less)
            if enough:
                return min(enough, key=lambda trial: trial.bic)
        return best

    def _better(self, best: Trial, other: Trial) -> Trial:
        return other if other.bic < best.bic else best

    def _swapped(self, best: Trial) -> Trial:
        """Return the best subset after exchanging single terms, as the quadratic model
        suggests.
        """
        for _ in range(self.policy.most_terms):
            if not best.names:
                return best
            found = best
            for names in self._exchanges(best):
                if names in self.trials.known:
                    continue
                trial = self.trials.attempt(names, best)
                if trial is not None:
                    found = self._better(found, trial)
            if found is best:
                return best
            best = self._smallest(found)
        return best

    def _exchanges(self, best: Trial, worse: float = 0.0) -> list[frozenset[str]]:
        """Return the subsets in which one term is exchanged and whose BIC is larger by
        less than `worse`, according to the quadratic model about the best fit.
        """
        blocks = self.trials.blocks(best)
        information, score = blocks.total()
        free = blocks.rows(self.trials.parameters(best.names))
        value = values_of(best.fit, blocks)
        top = gain(information, score, free)
        found = []
        for out in sorted(best.names):
            gone = blocks.rows([one.name for one in self.trials.term(out).strengths()])
            rest = np.setdiff1d(free, gone)
            step = np.zeros(len(blocks.names))
            step[gone] = -value[gone]
            cost = step @ information @ step - 2 * step @ score
            moved = score - information @ step
            for term in self.trials.terms:
                if term.name in best.names:
                    continue
                new = [one.name for one in term.strengths() if not one.inner]
                rows = np.union1d(rest, blocks.rows(new))
                change = top + cost - gain(information, moved, rows)
                extra = self.trials.count([term.name]) - self.trials.count([out])
                change = change + extra * math.log(self.trials.problem.samples)
                if change < worse:
                    found.append((change, (best.names - {out}) | {term.name}))
        # keep the most promising subsets; among equals, the first ones
        found.sort(key=lambda one: one[0])
        return [names for _, names in found[: self.policy.fitted_subsets]]

    def _promises(self, trial: Trial, scan: Periodogram) -> dict[frozenset[str], float]:
        """Return the subsets with one further term, each with its predicted BIC."""
        blocks = self.trials.blocks(trial)
        information, score = blocks.total()
        free = blocks.rows(self.trials.parameters(trial.names))
        found = {}
        for term in self.trials.terms:
            if term.name in trial.names:
                continue
            names = [one.name for one in term.strengths() if not one.inner]
            grown = added_gain(
                information,
                score,
                free,
                blocks.rows(names),
                self.policy.distinct_information,
            )
            if term.starts():
                grown = self.trials.placed(trial.names, term).gain
            elif any(one.inner for one in term.strengths()):
                grown = max(grown, scan.best[1])
                if grown < self._least_of_vibrations(trial):
                    continue
            if grown < self.trials.threshold(term.name):
                continue
            cost = trial.fit.cost - grown
            count = trial.count + self.trials.count([term.name])
            bic = cost + count * math.log(self.trials.problem.samples)
            found[trial.names | {term.name}] = bic
        return found

    def _least_of_vibrations(self, trial: Trial) -> float:
        """Return the predicted gain that a vibration must have to be fitted.

        If the fit is poor, any missing physics has components at all frequencies, and
        fits of a vibration take longest. A vibration must therefore reduce the excess
        cost substantially.
        """
        samples = self.trials.problem.samples
        if trial.fit.cost < self.policy.near_cost * samples:
            return 0.0
        return (1 - self.policy.helpful_cost) * (trial.fit.cost - samples)


def _bic(trial: Trial) -> float:
    return trial.bic
