"""Try forces that are products of two forms, each of an argument of its own.

Products are tried only if the functions of one argument leave something to explain, and
if a free function of two arguments promises more than the best function of one.
"""

import math
from collections.abc import Callable, Sequence

from ...fitting import Problem
from ..terms import Family, Where
from ._clock import Clock
from ._formulas import leaves_noise
from ._free_fits import FreeFits, Missing, Subset
from ._heat import heat_of, heated
from ._local_force import force_response
from ._product_forms import ProductSearch, ProductStart
from ._roughness import Roughness
from ._slots import emptied, filled, Free, replaced, slots_of
from ._surfaces import likelihood_of, Nodes, surfaces_of


class Products:
    """Fits of products of forms in place of the functions that were found.

    **Arguments:** the fits of subsets, families of functions, the problem with
    disconnected pieces and the complete one, `progress(sentence, fraction)`, and the
    clock.
    """

    def __init__(
        self,
        fits: FreeFits,
        families: Sequence[Family],
        problems: tuple[Problem, Problem],
        progress: Callable[[str, float | None], None],
        clock: Clock,
    ):
        self.fits, self.families, self.policy = fits, tuple(families), fits.policy
        self.apart, self.problem = problems
        self.progress, self.clock = progress, clock

    def tried(
        self, bare: Missing, found: Missing, least: float, small: float
    ) -> list[Missing]:
        """Return fits with a product of forms alone, the most promising first.

        A single form that leaves only noise has no rival among products.

        **Arguments:** the fit without functions, the fit with those found, the gain
        that a surface must exceed, and the tolerated residual.
        """
        alone = len(found.functions) == 1 and not found.names
        whole = alone and not any(one.smooth for one in found.functions)
        if whole and leaves_noise(self.fits, found, small):
            return []
        trials: list[Missing] = []
        beaten = self.policy.form_cost * found.fit.cost
        for start in self._promising(bare, least)[: self.policy.followed]:
            if self.clock.over:
                break
            label = f"{start.primitive.name} x {start.gate.primitive.name}"
            self.progress(f"fitting a product: {label}", None)
            trial = self._fitted(bare, start, beaten)
            if trial is not None:
                trials.append(trial)
        return trials

    def _promising(self, bare: Missing, least: float) -> list[ProductStart]:
        """Return products of all pairs of arguments whose surface promises enough."""
        self.progress("searching the residuals for products of functions", None)
        heat = heat_of(bare.fit)
        problem = heated(filled(self.apart, bare.functions), heat)
        response = force_response(problem, bare.fit.point, self.fits.free(bare))
        nodes = Nodes.of(problem, response, heat)
        alike, found = self.policy.distinct_information, []
        price = math.log(self.problem.samples)
        for surface in surfaces_of(self.families):
            likelihood = likelihood_of(nodes, surface, self.policy)
            if likelihood.rough.gain > least:
                search = ProductSearch(likelihood, price)
                found += search.promising(nodes, alike)
        return sorted(found, key=lambda one: -one.gain)

    def _fitted(
        self, bare: Missing, start: ProductStart, beaten: float
    ) -> Missing | None:
        """Fit a product to single pieces of flight, then to whole recordings.

        **Returns:** the fit, or `None` if it explains too little or if its parameters
        are not valid.
        """
        slot = slots_of(self.problem, Where.FLIGHT)[0]
        size = Roughness(size=abs(float(start.numbers[0])))
        one = Free(start.family, size, slot, start.primitive, start.gate)
        values = emptied(self.problem, bare.fit.point.values, slot)
        columns = [self.problem.names.index(name) for name in one.coefficients]
        point = bare.fit.point._replace(values=replaced(values, columns, start.numbers))
        trial, most = None, self.policy.iterations
        problems = [self.problem]
        if self.apart is not self.problem:
            problems.insert(0, self.apart)
        for problem in problems:
            subset = Subset(problem, (one,), frozenset())
            trial = self.fits.fitted(subset, point, most, beaten)
            point = trial.fit.point
            if not trial.fit.cost < beaten:
                return None
        assert trial is not None
        numbers = [trial.fit[name].value for name in one.coefficients]
        sound = math.isfinite(trial.score) and one.within(numbers)
        return trial if sound else None
