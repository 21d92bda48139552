"""Decide whether functions suffice, or elements with an internal state are needed."""

from collections.abc import Sequence

from ...fitting import Problem
from ..policy import Policy
from ._free_fits import FreeFits, heat_of, heated, Missing
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
        promised, best = self._promised(problem, bare), max(gains, default=0.0)
        self.preferred = promised > max(least, best)
        self.comparable = promised > max(least, self.policy.promising * best)

    def remains(self, problem: Problem, found: Missing | None, least: float) -> bool:
        """Return whether an element may explain what functions leave.

        If the fit with functions is far from the data, any element is predicted to
        gain; it must then explain most of what remains.

        **Arguments:** a fit with functions that leaves a residual, and the gain that an
        element must add to it.
        """
        if found is None:
            return self.comparable
        heat = heat_of(found.fit)
        if heat <= self.policy.near_cost:
            return self.comparable or self._promised(problem, found) > least
        left = (found.fit.cost - found.fit.problem.samples) / heat
        return self._promised(problem, found) > max(least, self.policy.explains * left)

    def _promised(self, problem: Problem, found: Missing) -> float:
        """Return the largest predicted gain of an element, minus the penalty for its
        parameters.
        """
        if self.driven is None:
            return 0.0
        heat = heat_of(found.fit)
        problem = heated(filled(problem, found.functions), heat)
        response = force_response(problem, found.fit.point, self.fits.free(found))
        some = worthwhile(problem, response, self.driven, self.policy, heat)
        return max((grown for grown, _ in some), default=0.0)
