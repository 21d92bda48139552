"""Fits without one of the functions or terms that were found."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ...fitting import Problem
from ...fitting.engine import Point
from ..policy import Policy
from ..terms import spelled, Term
from ._blocks import Blocks, blocks_of, moved, values_of
from ._free_fits import FreeFits, Missing, Subset
from ._gains import added_gain, distinct_step, gain
from ._heat import heat_of
from ._slots import emptied, filled, Part, replaced


class Without(NamedTuple):
    """The quadratic likelihood without a function or term: the increase in cost if
    nothing else changes (`worse`), the information and the score at that point, and the
    rows of the parameters that are kept.
    """

    worse: float
    blocks: Blocks
    information: np.ndarray
    score: np.ndarray
    kept: np.ndarray


class LeftOut:
    """Fits without one of the functions or terms that were found.

    **Arguments:** the fits, the candidate terms, `problem_of(fit)`, which returns the
    problem with connected pieces to which a fit belongs, and the policy.
    """

    def __init__(
        self,
        fits: FreeFits,
        terms: Sequence[Term],
        problem_of: Callable[[Missing], Problem],
        policy: Policy,
    ):
        self.fits, self.problem_of, self.policy = fits, problem_of, policy
        self.strengths = {t.name: [one.name for one in t.strengths()] for t in terms}

    def subset(self, found: Missing, out: Part | str) -> tuple[Subset, Point]:
        """Return the subset without a function or term, and a start for its fit."""
        slot = "" if isinstance(out, str) else out.slot
        functions = tuple(f for f in found.functions if f.slot != slot)
        names = found.names - {out} if isinstance(out, str) else found.names
        values, problem = found.fit.point.values, self.problem_of(found)
        if isinstance(out, str):
            rows = [problem.names.index(name) for name in self.strengths[out]]
            values = replaced(values, rows, 0.0)
        else:
            values = emptied(problem, values, out.slot)
        point = found.fit.point._replace(values=values)
        return Subset(problem, functions, names), point

    def predicted_loss(self, found: Missing, out: Part | str) -> float:
        """Return the increase in cost if a function or a term is left out, according to
        the quadratic likelihood about the fit.
        """
        without = self.quadratic(found, out)
        return without.worse - gain(without.information, without.score, without.kept)

    def quadratic(
        self, found: Missing, out: Part | str, more: Sequence[str] = ()
    ) -> Without:
        """Return the quadratic likelihood about a fit if a function or a term is left
        out.

        **Arguments:** `more`: names of further parameters, which are zero in the fit.
        """
        free, kept = self.fits.free(found), self.fits.free(self.subset(found, out)[0])
        problem = filled(found.problem, found.functions)
        blocks = blocks_of(problem, found.fit.point, names=[*free, *more])
        information, score = blocks.total()
        step = np.zeros(len(blocks.names))
        gone = blocks.rows(set(free) - set(kept))
        step[gone] = -values_of(found.fit, blocks)[gone]
        worse = float(step @ information @ step - 2 * step @ score)
        moved = score - information @ step
        return Without(worse, blocks, information, moved, blocks.rows(kept))

    def replacement(
        self, found: Missing, out: Part | str, most: float
    ) -> tuple[str, Point] | None:
        """Return the term that best replaces a function or term, according to the
        quadratic likelihood about the fit, and a start for its fit.

        **Arguments:** `most`: the largest increase in cost with the replacement; `None`
        is returned if every term would increase it more.
        """
        offered = {t: own for t, own in self.strengths.items() if t not in found.names}
        if not offered:
            return None
        every = [name for own in offered.values() for name in own]
        least = self.policy.distinct_information
        without = self.quadratic(found, out, every)
        quadratic = without.information, without.score, without.kept
        own_rows = {t: without.blocks.rows(own) for t, own in offered.items()}
        gains = {t: added_gain(*quadratic, own, least) for t, own in own_rows.items()}
        best = max(gains, key=lambda one: gains[one])
        left = without.worse - gain(*quadratic) - gains[best]
        if not left < most:
            return None
        # the force of the term replaces that of the part left out from the start
        rows = np.union1d(without.kept, own_rows[best])
        step = distinct_step(without.information, without.score, rows, least)
        _, point = self.subset(found, out)
        values = moved(found.problem, without.blocks, point.values, rows, step)
        return best, point._replace(values=values)

    def pruned(self, found: Missing, allowed: Callable[[Missing], float]) -> Missing:
        """Return the fit without the functions and terms that are not needed.

        **Arguments:** `allowed(fit)`, the increase in the score below which a function
        or term is not needed.
        """
        for one in (*found.functions, *sorted(found.names)):
            if len(found.functions) + len(found.names) < 2:
                break
            least = allowed(found)
            if self.predicted_loss(found, one) > self.policy.clear_gain * least:
                continue
            subset, point = self.subset(found, one)
            less = self.fits.fitted(subset, point, beaten=found.score + least)
            if less.score - found.score < least:
                found = less
        return found

    def swapped(
        self,
        found: Missing,
        problems: Sequence[Problem],
        small: Callable[[Missing], float],
        progress,
        share: float = 0.0,
    ) -> Missing:
        """Replace earlier functions by terms that explain more, or nearly as much.

        A function found while the fit is poor may represent two effects.

        **Arguments:** the fit; the problems to fit in turn, the last of which decides;
        `small(fit)`, the tolerated increase in cost; the `share` of the explained cost
        that the replacement of a function may lose.
        """
        for out in (*found.functions, *sorted(found.names)):
            rest, _ = self.subset(found, out)
            most = self.policy.lead_bic * heat_of(found.fit) + small(found)
            replaced = self.replacement(found, out, most)
            if replaced is None:
                continue
            rival, point = replaced
            limit = found.score
            if not isinstance(out, str):
                limit += share * small(found) / self.policy.small
            progress(f"fitting {spelled(rival)}", None)
            names, trial = rest.names | {rival}, None
            for problem in problems:
                subset = Subset(problem, rest.functions, names)
                trial = self.fits.fitted(subset, point, beaten=limit)
                point = trial.fit.point
                # disconnected pieces cost less than connected ones
                if not trial.fit.cost < limit:
                    break
            if trial is not None and trial.score < limit:
                return self.swapped(trial, problems, small, progress, share)
        return found
