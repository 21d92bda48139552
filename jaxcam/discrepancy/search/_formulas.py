"""Replace free functions by parametric forms, fitted to the recordings.

The free function gives the starting values of a form; the evidence of a fit to whole
trajectories decides whether the form is kept.
"""

import dataclasses
import math

import numpy as np

from ...fitting import Problem
from ...fitting.engine import Point
from ._clock import Clock
from ._curve_likelihood import CurveLikelihood, promising, Start
from ._free_fits import FreeFits, Missing, Subset
from ._heat import heat_of
from ._hidden_state import Hidden
from ._leads import shows_apart
from ._named_parts import friction_named, with_named_friction
from ._roughness import Roughness
from ._slots import emptied, Free, Part, replaced
from ._sums_of_forms import SumSearch
from ._unexplained import leaves_noise


def formulated(
    fits: FreeFits, found: Missing, apart: Problem, small: float, progress, clock: Clock
) -> tuple[Missing, list[Missing]]:
    """Replace the functions of a fit by forms that have about as much evidence.

    **Arguments:** `apart`: the problem with disconnected pieces. `small`: the tolerated
    increase in cost. `clock`: the limit of the time.

    **Returns:** the fit, and all fits with forms.
    """
    tried: list[Missing] = []
    for slot in [one.slot for one in found.functions]:
        # the function may have changed while another one was replaced
        one = _in_slot(found, slot)
        if isinstance(one, Hidden) or not one.smooth or clock.over:
            continue
        likelihood = CurveLikelihood.about(fits, found, one)
        trials = _Trials(fits, found, apart, one, small, progress, clock)
        trials.run(trials.compared(promising(likelihood, fits.policy.followed)))
        search = None
        if trials.kept is None and not trials.close:
            search = SumSearch(likelihood, fits.policy.small)
            sums = search.promising(fits.policy.followed)
            trials.run([start for start in sums if trials.may_do(start, likelihood)])
        tried += trials.sound
        found = trials.kept or found
        if friction_named(fits, found, one):
            allowed, form = fits.policy.form_loss, _in_slot(found, slot)
            assert isinstance(form, Free)
            if form.primitive is not None:
                sums = [(form.primitive, _numbers_of(found, form))]
            else:
                search = search or SumSearch(likelihood, fits.policy.small)
                allowed += fits.policy.corner_share * small / fits.policy.small
                sums = search.with_friction(fits.policy.followed)
            named = with_named_friction(fits, found, form, sums, progress, clock)
            named = [trial for trial in named if _sound(trial, form)]
            tried += named
            best = min(named, key=lambda trial: trial.score, default=found)
            found = best if best.score < found.score + allowed else found
    return found, tried


def _numbers_of(found: Missing, one: Free) -> np.ndarray:
    """Return the fitted parameters of a function."""
    return np.array([found.fit[name].value for name in one.coefficients])


class _Trials:
    """Fits of forms in place of one of the functions of a fit.

    `sound`: the fits with finite evidence and valid parameters.
    """

    def __init__(
        self,
        fits: FreeFits,
        found: Missing,
        apart: Problem,
        one: Free,
        small: float,
        progress,
        clock: Clock,
    ):
        self.clock = clock
        self.fits, self.found, self.apart = fits, found, apart
        self.one, self.small, self.progress = one, small, progress
        self.sound: list[Missing] = []
        # fits to disconnected pieces from which those to whole recordings start
        self.on_pieces: dict[str, Missing | None] = {}

    @property
    def kept(self) -> Missing | None:
        """Return the fit with the most evidence if the evidence is about as high as
        that of the function, or higher.
        """
        best = min(self.sound, key=lambda trial: trial.score, default=self.found)
        allowed = self.found.score + self.fits.policy.form_loss
        return best if self.sound and best.score < allowed else None

    @property
    def close(self) -> bool:
        """Return whether a form explains almost as much as the function."""
        allowed = self.found.fit.cost + self.small
        return any(trial.fit.cost < allowed for trial in self.sound)

    def compared(self, starts: list[Start]) -> list[Start]:
        """Return the forms in the order of their evidence on disconnected pieces.

        If a function leaves more than noise, the gains predicted from it are not
        reliable. A form whose cost on disconnected pieces is a multiple of the least
        one is then left out.
        """
        policy, found = self.fits.policy, self.found
        if len(starts) < 2 or not self._shows_apart or leaves_noise(self.fits, found):
            return starts
        for start in starts:
            if self.clock.over:
                return starts
            self.progress(f"fitting a formula: {start.primitive.name}", None)
            self.on_pieces[start.primitive.name] = self._on_pieces(start)
        fits = [(start, self.on_pieces[start.primitive.name]) for start in starts]
        sound = [(start, fit) for start, fit in fits if fit and _sound(fit, self.one)]
        least = min((fit.fit.cost for _, fit in sound), default=math.inf)
        return [
            start._replace(gain=-fit.score / heat_of(found.fit))
            for start, fit in sorted(sound, key=lambda pair: pair[1].score)
            if fit.fit.cost <= policy.hopeless_cost * least
        ]

    def run(self, waiting: list[Start]) -> None:
        """Fit forms in turn, until the next one is unlikely to have more evidence.

        A form is followed by its special cases, such as that for an exponent of one.
        """
        waiting, done, least = list(waiting), set(), -math.inf
        while waiting and not self.clock.over:
            start = waiting.pop(0)
            gain, form, _ = start
            if gain < least:
                break
            if form.name in done:
                continue
            done.add(form.name)
            self.progress(f"fitting a formula: {form.name}", None)
            trial = self._fitted(start)
            if trial is None:
                continue
            fitted: Free = _in_slot(trial, self.one.slot)  # pyright: ignore
            numbers = _numbers_of(trial, fitted).tolist()
            # an edge outside the range is not valid, and is not needed
            for special in form.special:
                if all(map(math.isfinite, numbers)) and special.applies(numbers):
                    own = np.array(special.numbers(numbers))
                    waiting.insert(0, Start(gain, special.form, own))
            if not _sound(trial, self.one):
                continue
            self.sound.append(trial)
            if trial.score < self.found.score:
                # only a form with a similar predicted gain may have more evidence
                least = max(least, gain - self.fits.policy.lead_bic)

    def may_do(self, start: Start, likelihood: CurveLikelihood) -> bool:
        """Return whether a form is expected to have about as much evidence as the
        function.
        """
        price = start.primitive.count * likelihood.price
        lost = heat_of(self.found.fit) * (likelihood.gain - start.gain - price)
        worse = lost + price - likelihood.freedom
        return worse < self.fits.policy.form_loss + self.fits.policy.lead_bic

    @property
    def _shows_apart(self) -> bool:
        """Whether disconnected pieces contain information on the function."""
        return self.apart is not self.found.problem and shows_apart(self.one.family)

    @property
    def _beaten(self) -> float:
        """The cost below which a form explains about as much as the function."""
        cost = self.found.fit.cost
        return max(self.fits.policy.form_cost * cost, cost + self.small)

    def _in_place(self, start: Start) -> tuple[tuple[Part, ...], Point]:
        """Return the functions of the fit with a form in place of one of them, and a
        start for their fit.
        """
        found, one, problem = self.found, self.one, self.found.problem
        size = Roughness(size=abs(float(start.numbers[0])))
        form = dataclasses.replace(one, primitive=start.primitive, roughness=size)
        functions = tuple(form if f.slot == one.slot else f for f in found.functions)
        values = emptied(problem, found.fit.point.values, one.slot)
        columns = [problem.names.index(name) for name in form.coefficients]
        values = replaced(values, columns, start.numbers)
        return functions, found.fit.point._replace(values=values)

    def _on_pieces(self, start: Start) -> Missing | None:
        """Fit a form in place of the function to disconnected pieces: an almost linear
        problem.

        **Returns:** the fit, or `None` if the form explains much less than the
        function.
        """
        functions, point = self._in_place(start)
        subset = Subset(self.apart, functions, self.found.names)
        return self._unless_beaten(subset, point)

    def _fitted(self, start: Start) -> Missing | None:
        """Fit a form in place of the function to whole recordings.

        **Returns:** the fit, or `None` if the form explains much less than the
        function.
        """
        functions, point = self._in_place(start)
        if self._shows_apart:
            first = self.on_pieces.get(start.primitive.name) or self._on_pieces(start)
            if first is None:
                return None
            point, functions = first.fit.point, first.functions
        subset = Subset(self.found.problem, functions, self.found.names)
        return self._unless_beaten(subset, point)

    def _unless_beaten(self, subset: Subset, point: Point) -> Missing | None:
        trial = self.fits.fitted(subset, point, beaten=self._beaten)
        return trial if trial.fit.cost < self._beaten else None


def _in_slot(found: Missing, slot: str):
    """Return the function of a fit that occupies a slot."""
    return next(one for one in found.functions if one.slot == slot)


def _sound(trial: Missing, one: Free) -> bool:
    """Return whether a form has finite evidence and valid parameters."""
    form = _in_slot(trial, one.slot)
    assert isinstance(form, Free) and form.primitive is not None
    numbers = _numbers_of(trial, form).tolist()
    return math.isfinite(trial.score) and form.within(numbers)
