"""Decide whether functions suffice, or elements with an internal state are needed."""

from collections.abc import Sequence

from ...fitting import Problem
from ..policy import Policy
from ._free_fits import FreeFits, Missing
from ._heat import heat_of, heated
from ._hidden_leads import worthwhile
from ._hidden_signals import Driven
from ._local_force import force_response
from ._slots import filled


class ElementNeed:
    """Compares the predicted gains of elements with those of functions.

    No element is fitted, because a scan takes seconds, whereas a search with elements
    takes minutes.

    **Arguments:** the fits of subsets, the position that drives an element (`None` if
    elements are not tried, or are candidates anyway), and the policy.
    """

    def __init__(self, fits: FreeFits, driven: Driven | None, policy: Policy):
        self.fits, self.driven, self.policy = fits, driven, policy
        # whether an element is predicted to gain more than any function or term
        self.preferred = False
        # whether that gain exceeds `policy.promising` times the largest gain of a
        # function or term
        self.comparable = False

    def compare(
        self, problem: Problem, bare: Missing, gains: Sequence[float], least: float
    ) -> None:
        """Compare an element with the first functions and terms.

        **Arguments:** a fit without functions; the predicted gains of adding single
        functions and terms to this fit; and the required gain.
        """
        best = max(gains, default=0.0)
        enough = max(least, self.policy.promising * best)
        promised = self._promised(problem, bare, enough)
        self.preferred = promised > max(least, best)
        self.comparable = promised > enough

    def remains(self, problem: Problem, found: Missing | None, least: float) -> bool:
        """Return whether an element may explain what functions leave.

        If the fit with functions is poor, any element is predicted to gain; it must
        then explain most of what remains.

        **Arguments:** a fit with functions that leaves a residual above the noise, and
        the gain that an element must add to it.
        """
        if found is None:
            return self.comparable
        heat = heat_of(found.fit)
        if heat <= self.policy.near_cost:
            return self.comparable or self._promised(problem, found, least) > least
        left = (found.fit.cost - found.fit.problem.samples) / heat
        least = max(least, self.policy.explains * left)
        return self._promised(problem, found, least) > least

    def _promised(self, problem: Problem, found: Missing, least: float) -> float:
        """Return the largest predicted gain of an element, minus the penalty for its
        parameters; at or below `least`, the gain may be that of a rejected resonance.
        """
        if self.driven is None:
            return 0.0
        heat = heat_of(found.fit)
        problem = heated(filled(problem, found.functions), heat)
        response = force_response(problem, found.fit.point, self.fits.free(found))
        some = worthwhile(problem, response, self.driven, self.policy, heat, least)
        return max((grown for grown, _ in some), default=0.0)
