"""Search for unnamed functions in addition to named terms, by their evidence.

The search first uses individual pieces of flight, which do not depend on impacts and
other flights, and then whole recordings.
"""

import copy
import math
from collections.abc import Callable, Sequence

from scipy.stats import chi2

from ...fitting import Problem
from ...fitting.engine import Point
from ..policy import Policy
from ..terms import Family, own_faults, spelled, Term
from ._additions import Additions
from ._clock import Clock
from ._element_need import ElementNeed
from ._formulas import formulated
from ._free_fits import FreeFits, Missing, Subset
from ._heat import heat_of
from ._hidden_kinds import KINDS
from ._hidden_leads import simplified
from ._leads import Lead, Leads, of_two_arguments, others, tie
from ._left_out import LeftOut
from ._recentre import recentred
from ._rooms import Rooms
from ._shuffled import Shuffled, shuffled
from ._two_arguments import TwoArguments
from ._unexplained import completes, completing_gain, leaves_noise, parts_lacking


class FreeSearch:
    """Adds functions and terms one by one, as long as the evidence increases.

    **Arguments:** the problem, names of the rig parameters, candidate terms, families
    of functions, the policy, `progress(sentence, fraction)`, the cost of the model
    without any of them, whether elements with an internal state are candidates, the
    clock that limits the time, and whether model errors are allowed for.
    """

    def __init__(
        self,
        problem: Problem,
        rig: Sequence[str],
        terms: Sequence[Term],
        families: Sequence[Family],
        policy: Policy,
        progress: Callable[[str, float | None], None],
        cost: float,
        elements: bool = False,
        clock: Clock | None = None,
        roughly: bool = False,
    ):
        self.cost, self.clock = cost, clock or Clock(policy.minutes)
        self.policy, self.progress = policy, progress
        self.terms = [t for t in terms if not any(s.inner for s in t.strengths())]
        self.fits = FreeFits(rig, self.terms, policy)
        self.families = tuple(families)
        # fits of whole recordings with other functions, or other forms of them
        self.tried: list[Missing] = []
        # formulas found before, with the fit in which they were sought
        self.formulas: dict[int, tuple[Missing, Missing, list[Missing]]] = {}
        # candidates for the first function, and the fits of single pieces with them
        self.first: list[Lead] | None = None
        self.alone: dict[str, Missing] = {}
        self.rooms = Rooms(
            problem, self.families, elements or policy.elements > 0, roughly
        )
        self.elements = elements and self.rooms.driven is not None
        left = None if elements else self.rooms.driven
        self.need = ElementNeed(self.fits, left, policy)
        # with model errors, the predicted gains of elements are not reliable
        self.roughly = roughly
        self.apart, self.problem = self.rooms.plain
        self.additions = Additions(self.fits, self.rooms)
        # unnamed functions must not represent the gain, offset and lag of a sensor
        faults = own_faults(self.problem.model, self.problem.parameters)
        rooms = self.rooms
        self.left_out = LeftOut(
            self.fits, self.terms, lambda found: rooms.of(found).whole, policy
        )
        self.leads = Leads(self.fits, self.families, faults, policy, progress)
        self.of_two = TwoArguments(self.fits, families, rooms, progress, self.clock)

    def repeated(self, elements: bool) -> "FreeSearch":
        """Return a search with elements among the candidates, or with functions alone;
        it does not repeat the fits made before.
        """
        other = copy.copy(self)
        other.tried, other.first, other.alone = [], None, {}
        other.elements = elements and self.rooms.driven is not None
        other.need = ElementNeed(self.fits, None, self.policy)
        return other

    def run(self) -> Missing | None:
        """Return the functions and terms found, or `None` if none is significant.

        The search ends as soon as it prefers an element that is not a candidate.
        """
        bare = self._bare(self.apart, self.problem.start)
        trials = self._of_two_first(bare)
        if trials and self._suffices(trials[0]):
            return trials[0]
        found = None if self.need.preferred else self._functions(bare)
        if found is not None and self.first and not trials:
            trials = self._of_two(bare, found)
        every = trials if found is None else [found, *trials]
        return min(every, key=lambda trial: trial.score, default=None)

    def _of_two_first(self, bare: Missing) -> list[Missing]:
        """Return fits with forces of two arguments, the best first, if they promise
        more than functions of one argument do.
        """
        small = heat_of(bare.fit) < self.policy.as_noise
        if small or self.elements or not math.isfinite(bare.score):
            return []
        leads = self._ranked(self.apart, bare, True)
        if self.need.preferred or not leads:
            return []
        least = self._least()
        if not self.of_two.promise_more(bare, leads, least):
            return []
        return self._of_two(bare, bare)

    def _of_two(self, bare: Missing, found: Missing) -> list[Missing]:
        """Return fits with forces of two arguments in place of the functions found, and
        with other functions and terms in addition, the best first.
        """
        assert self.first
        least = self.first[0].gain + self._least()
        # disconnected pieces do not show how much will be explained
        small = self._small(found) if found.functions else self.policy.small * self.cost
        trials = self.of_two.tried(bare, found, least, small)
        self.tried += trials
        trials.sort(key=lambda trial: trial.score)
        if trials and not (leaves_noise(self.fits, trials[0]) or self.clock.over):
            more = self._grown(trials[0], False)
            if not completes(self.fits, trials[0], more):
                more = self._pruned(more)
            trials = [more, *trials] if more.functions else trials
        return trials

    def _suffices(self, found: Missing) -> bool:
        return leaves_noise(self.fits, found, self._small(found))

    def _functions(self, bare: Missing) -> Missing | None:
        """Return functions of one argument and terms, or `None`."""
        found = self._grown(bare, True)
        if self.need.preferred:
            return None
        most = self.policy.iterations
        found = self.fits.fitted(self._tight(found), found.fit.point, most)
        found = self._grown(found, False)
        if self.need.preferred or not math.isfinite(found.score):
            return None
        swapped = self._swapped(found)
        if swapped is not found:
            found = self._grown(swapped, False)
        if not found.functions:
            return None
        whole = recentred(self.fits, found)
        found = self._pruned(whole)
        problem = self.rooms.of(found).whole
        found = simplified(self.fits, problem, found, self.progress)
        curve, found = found, self._formulated(found)
        if parts_lacking(self.fits, curve, found, whole):
            # forms do not make up for the parts left out: start from the complete fit
            curve, found = whole, self._formulated(whole)
        if len(curve.functions) > 1 or curve.names:
            # next to a form, a term may explain what it does not next to a curve
            renamed = self._swapped(found, self.policy.corner_share)
            return renamed if renamed.functions else found
        # a form may score slightly worse than the function that it replaces
        best = min(curve.score, found.score)
        chosen = next(one.label for one in curve.functions)
        for lead in others(self.first or (), self.alone, self.tried, self.policy):
            if self.clock.over:
                break
            noise = leaves_noise(self.fits, found, self._small(found))
            if noise and not tie(self.alone, lead.label, chosen, self.policy):
                continue
            curve = self._rival_function(bare, lead)
            if curve is None:
                continue
            other = self._formulated(curve)
            score = min(curve.score, other.score)
            if score < best:
                found, best = other, score
        return found

    def _formulated(self, found: Missing) -> Missing:
        self.tried.append(found)
        if id(found) not in self.formulas:
            small, apart = self._small(found), self.rooms.of(found).apart
            made = formulated(self.fits, found, apart, small, self.progress, self.clock)
            self.formulas[id(found)] = found, *made
        _, best, forms = self.formulas[id(found)]
        self.tried += forms
        return best

    def _rival_function(self, bare: Missing, lead: Lead) -> Missing | None:
        """Return the fit with another function alone, or `None` if it fails.

        On single pieces of flight, a smooth function may score better than the right
        one.
        """
        self.progress(f"fitting {spelled(lead.label)} instead", None)
        found = self.additions.fitted(bare, lead, False)
        if found is not None:
            found = recentred(self.fits, found)
            self.tried.append(found)
        return found

    def lacks_element(self, found: Missing | None) -> bool:
        """Return whether to repeat the search with elements among the candidates.

        This is the case if an element is preferred to every function, or if it may
        explain a residual that the functions leave. If model errors are allowed for, a
        residual always remains, and the functions must explain little.
        """
        if self.need.preferred or not self.falls_short(found):
            return self.need.preferred
        if self.roughly and self.need.driven is not None:
            left = self.cost if found is None else found.fit.cost
            return left > self.policy.element_misfit * self.cost
        least = self._least()
        if found is not None:
            least = max(least, self._small(found) / heat_of(found.fit))
        problem = self.problem if found is None else self.rooms.of(found).whole
        return self.need.remains(problem, found, least)

    def falls_short(self, found: Missing | None, tolerated: bool = True) -> bool:
        """Return whether nothing was found, or a residual above the noise is left.

        **Arguments:** whether a part of the `tolerated` residual counts as noise.
        """
        if found is None:
            return True
        small = self._small(found) if tolerated else 0.0
        return not leaves_noise(self.fits, found, small)

    def _bare(self, problem: Problem, start: Point) -> Missing:
        nothing = Subset(problem, (), frozenset())
        return self.fits.fitted(nothing, start, self.policy.iterations)

    def _tight(self, found: Missing) -> Subset:
        return Subset(self.rooms.of(found).whole, found.functions, found.names)

    def _grown(self, found: Missing, apart: bool) -> Missing:
        """Add functions or terms one at a time."""
        # a failed fit cannot be extended
        most = self.policy.most_terms if math.isfinite(found.score) else 0
        while len(found.functions) + len(found.names) < most:
            if apart and heat_of(found.fit) < self.policy.as_noise:
                # single pieces of flight contain little information on small effects
                break
            if of_two_arguments(found) and leaves_noise(self.fits, found):
                break
            room = self.rooms.of(found)
            leads = self._ranked(room.apart if apart else room.whole, found, apart)
            if self.need.preferred:
                break
            best = found
            for lead in leads:
                if self._done(best, lead, leads[0]) or self.clock.over:
                    break
                self.progress(f"fitting {spelled(lead.label)}", None)
                trial = self.additions.fitted(found, lead, apart, found.score)
                if trial is not None and not apart:
                    self.tried.append(trial)
                elif trial is not None and not (found.functions or found.names):
                    self.alone[lead.label] = trial
                if trial is not None and trial.score < best.score:
                    best = trial
            grown = found.score - best.score
            if best is found or grown < heat_of(best.fit) * self._least():
                break
            if found.functions and grown < self._worthwhile(found):
                break
            minor = not apart and found.functions and grown < self._small(found)
            if minor and not completes(self.fits, found, best):
                break
            found = best
        return found

    def _ranked(self, problem: Problem, found: Missing, apart: bool) -> list[Lead]:
        """Return the candidates to add to a fit; before anything is added, also compare
        them with elements.
        """
        leads = self._leads(problem, found, apart)
        if self.first is None:
            self.first = leads
            gains = [*(lead.gain for lead in leads), self.of_two.promised(found)]
            if not self.roughly:
                self.need.compare(problem, found, gains, self._least())
        return leads

    def _done(self, best: Missing, lead: Lead, first: Lead) -> bool:
        """Return whether the data are explained so well that a candidate need not be
        tried.
        """
        close = lead.gain > self.policy.rivalling * first.gain
        return leaves_noise(self.fits, best) and not close

    def _small(self, found: Missing) -> float:
        """Return the gain that may remain unused, given the gain of the fit so far."""
        return self.policy.small * max(self.cost - found.fit.cost, 0.0)

    def _worthwhile(self, found: Missing) -> float:
        """Return the gain that an addition to a fit must have if model errors are
        allowed for: some residual always remains.
        """
        return self.policy.worthwhile * found.fit.cost if self.roughly else 0.0

    def _least(self) -> float:
        """Return the increase in twice the log-evidence that an addition requires."""
        tests = len(self.families) + len(self.terms) + len(KINDS)
        chance = self.policy.false_alarms / tests
        least = max(float(chi2.isf(chance, 1)), math.log(self.problem.samples))
        return (math.sqrt(least) + self.policy.beyond) ** 2

    def _leads(self, problem: Problem, found: Missing, apart: bool) -> list[Lead]:
        """Return the candidates with a sufficient predicted gain, the best first."""
        driven = self.rooms.driven if self.elements else None
        leads = self.leads.ranked(problem, found, apart, driven)
        if not leads:
            return []
        least = max(self._least(), self.policy.promising * leads[0].gain)
        of_term = enough = least
        if found.functions:
            more = self._worthwhile(found) if apart else self._small(found)
            of_term = enough = max(least, more / heat_of(found.fit))
            if not apart:
                of_term = max(least, min(enough, completing_gain(self.fits, found)))
        kept = [one for one in leads if one.gain > (of_term if one.name else enough)]
        return kept[: self.policy.followed]

    def _swapped(self, found: Missing, share: float = 0.0) -> Missing:
        room = self.rooms.of(found)
        problems = (room.whole,) if self.roughly else room
        return self.left_out.swapped(found, problems, self._small, self.progress, share)

    def shuffled(self, found: Missing, seed: int) -> tuple[Shuffled, ...]:
        """Return the gains of the knockoffs of all forces."""
        apart = self.rooms.of(found).apart
        return shuffled(self.fits, apart, found, self.policy, seed)

    def without(self, found: Missing, label: str) -> Missing:
        """Return the fit without the function or term that has the given label."""
        labels = {one.label: one for one in found.functions}
        return self.fits.fitted(*self.left_out.subset(found, labels.get(label, label)))

    def _pruned(self, found: Missing) -> Missing:
        """Return the fit without the functions and terms that are not needed."""
        return self.left_out.pruned(
            found, lambda one: max(heat_of(one.fit) * self._least(), self._small(one))
        )
