"""Fit forces that are products of two forms, each of an argument of its own."""

import math
from collections.abc import Callable, Sequence

from ...fitting.engine import Point
from ..terms import Where
from ._clock import Clock
from ._free_fits import FreeFits, Missing, Subset
from ._product_forms import ProductStart
from ._rooms import Room
from ._roughness import Roughness
from ._slots import emptied, Free, replaced, slots_of


class Products:
    """Fits of products of forms.

    **Arguments:** the fits of subsets, the problems with room for a function,
    `progress(sentence, fraction)`, and the clock.
    """

    def __init__(
        self,
        fits: FreeFits,
        room: Room,
        progress: Callable[[str, float | None], None],
        clock: Clock,
    ):
        self.fits, self.room = fits, room
        self.progress, self.clock = progress, clock

    def tried(
        self, starts: Sequence[ProductStart], point: Point, beaten: float
    ) -> list[Missing]:
        """Return fits with a product of forms alone, the most promising first.

        **Arguments:** products of forms; the other parameters and the states from which
        the fits start; the cost below which a product explains enough.
        """
        trials: list[Missing] = []
        for start in starts[: self.fits.policy.followed]:
            if self.clock.over:
                break
            label = f"{start.primitive.name} x {start.gate.primitive.name}"
            self.progress(f"fitting a product: {label}", None)
            trial = self._fitted(start, point, beaten)
            if trial is not None:
                trials.append(trial)
        return trials

    def _fitted(
        self, start: ProductStart, point: Point, beaten: float
    ) -> Missing | None:
        """Fit a product to single pieces of flight, then to whole recordings.

        **Returns:** the fit, or `None` if it explains too little or if its parameters
        are not valid.
        """
        problem = self.room.whole
        slot = slots_of(problem, Where.FLIGHT)[0]
        size = Roughness(size=abs(float(start.numbers[0])))
        one = Free(start.family, size, slot, start.primitive, start.gate)
        columns = [problem.names.index(name) for name in one.coefficients]
        values = emptied(problem, point.values, slot)
        point = point._replace(values=replaced(values, columns, start.numbers))
        trial, most = None, self.fits.policy.iterations
        for problem in self.room.stages:
            subset = Subset(problem, (one,), frozenset())
            trial = self.fits.fitted(subset, point, most, beaten)
            point = trial.fit.point
            if not trial.fit.cost < beaten:
                return None
        assert trial is not None
        numbers = [trial.fit[name].value for name in one.coefficients]
        sound = math.isfinite(trial.score) and one.within(numbers)
        return trial if sound else None
