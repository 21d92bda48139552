"""List other explanations, the best first, each with the reason for its rejection."""

import math
from collections.abc import Iterator, Sequence

from ...fitting import Fit
from ..evidence import Choice, Rival
from ..policy import Policy
from ..search import added_gain, Missing, Trial, Trials
from ._diagnosis import Alternative
from ._missing import named_function


def fitted_alternatives(trials: Trials, choice: Choice) -> list[Trial]:
    """Return the other fitted subsets, the best first.

    A subset that contains the chosen one is not another explanation. A subset without
    the term that replaces a parameter outside its tolerance is not an explanation at
    all.
    """
    best = choice.named.best
    needed = {one.term for one in choice.named.beyond if one.term}
    found = [
        trial
        for names, trial in trials.known.items()
        if names != best.names and not names > best.names and needed <= names
    ]
    return sorted(found, key=lambda trial: trial.bic - best.bic)


def alternatives_of(trials: Trials, choice: Choice) -> tuple[Alternative, ...]:
    """Return all alternatives to the chosen explanation, ranked by BIC.

    These are the other fitted subsets, and the chosen terms with each further term,
    even if its predicted gain was too small for a fit.
    """
    best = choice.named.best
    found = [
        Alternative(_name(trial), trial.bic - best.bic, _terms(trial), reason)
        for trial in fitted_alternatives(trials, choice)
        for reason in [_worse(trials, choice, trial)]
    ]
    found += _additions(trials, choice)
    found.sort(key=lambda one: one.delta_bic)
    most = trials.policy.alternatives
    # a single term is always listed, however many subsets are better
    singles = [one for one in found[most:] if len(one.terms) == 1]
    return (*found[:most], *singles)


def alternatives_to_functions(
    trials: Trials, missing: Missing, rivals: Sequence[Rival]
) -> tuple[Alternative, ...]:
    """Return other functions and forms, then the fit with named terms alone."""
    policy = trials.policy
    found = [
        Alternative(
            rival_name(rival),
            rival.worse,
            tuple(sorted(rival.missing.names)),
            _why_not(rival, policy),
        )
        for rival in rivals
    ]
    named = sorted(trials.known.values(), key=lambda trial: trial.bic)
    textbook = trials.known[frozenset()].fit
    found += [
        Alternative(
            _name(trial),
            trial.bic - missing.score,
            _terms(trial),
            explains_less(textbook, trial.fit, missing.fit),
        )
        for trial in named[: policy.alternatives]
    ]
    return tuple(sorted(found, key=lambda one: one.delta_bic))


def rival_name(rival: Rival) -> str:
    """Return the functions and terms of another explanation."""
    one = rival.missing
    functions = [named_function(one.fit, part) for part in one.functions]
    return " + ".join([*functions, *sorted(one.names)]) or "none"


def _why_not(rival: Rival, policy: Policy) -> str:
    found = rival.missing.fit
    if found.cost > policy.near_cost * found.problem.samples:
        return "its fit is poor"
    return f"would be chosen in {rival.share:.0%} of the bootstrap samples"


def _additions(trials: Trials, choice: Choice) -> Iterator[Alternative]:
    """Yield the chosen terms with each further term added, and the gain of that
    term.
    """
    best, price = choice.named.best, math.log(trials.problem.samples)
    blocks = trials.blocks(best)
    information, score = blocks.total()
    free = blocks.rows(trials.parameters(best.names))
    uncertain = choice.named.doubtful, choice.named.masked, choice.named.imitating
    dropped = {name for each in uncertain for name, _ in each}
    for term in trials.terms:
        if term.name in best.names:
            continue
        names = best.names | {term.name}
        known = trials.known.get(names)
        inner = any(one.inner for one in term.strengths())
        if known is not None:
            gain = best.fit.cost - known.fit.cost
        elif inner:
            gain = trials.scan(best.names).best[1]
        else:
            own = blocks.rows([one.name for one in term.strengths()])
            gain = added_gain(
                information, score, free, own, trials.policy.distinct_information
            )
        asked = trials.threshold(term.name)
        number = trials.count([term.name])
        reason = _not_added(
            gain, asked, number, known is not None, term.name in dropped
        )
        delta = number * price - gain
        terms = tuple(sorted(names))
        yield Alternative("+".join(terms), delta, terms, reason)


def _not_added(
    gain: float, asked: float, number: int, fitted: bool, dropped: bool
) -> str:
    """Return the reason why a term was not added, given its gain, the gain that is
    required, the number of its strengths, and whether the term was fitted and then
    dropped.
    """
    gain = max(gain, 0.0)
    if gain < asked and number == 1:
        # with one strength, the gain is the square of its significance
        return (
            f"too small to be distinguished from noise: its strength is "
            f"{math.sqrt(gain):.2g} standard errors, and {math.sqrt(asked):.2g} are "
            f"required"
        )
    if gain < asked:
        return (
            f"too small to be distinguished from noise: twice the log-likelihood would "
            f"increase by {gain:.3g}, and {asked:.3g} is required for {number} "
            f"parameters"
        )
    if dropped:
        cause = "the term is doubtful (see the caveat)"
    elif fitted:
        cause = "the bootstrap tests only the subset that the search chose"
    else:
        cause = "this is a prediction: the subset was not fitted"
    return (
        f"would increase twice the log-likelihood by {gain:.3g} ({asked:.3g} "
        f"required), but {cause}"
    )


def _worse(trials: Trials, choice: Choice, trial: Trial) -> str:
    """Return the reason why a fitted subset is not the named one."""
    best = choice.named.best
    if not trials.settled(trial):
        return "its fit is poor"
    if abs(trial.bic - best.bic) < trials.policy.tie:
        return "explains as much: these recordings cannot distinguish between the two"
    if trial.bic < best.bic:
        return "fits better, but not all of its terms are certain"
    # like the other subsets, with rig parameters that may leave their tolerances
    textbook = trials.known[frozenset()].fit
    return explains_less(textbook, trial.fit, best.fit)


def explains_less(textbook: Fit, found: Fit, best: Fit) -> str:
    """Say how much of the misfit that the chosen fit explains another fit explains."""
    whole = textbook.cost - best.cost
    share = (textbook.cost - found.cost) / whole if whole > 0 else math.nan
    samples = best.problem.samples
    rms, least = (math.sqrt(one.cost / samples) for one in (found, best))
    left = f"its residual is {rms:.3g} times the noise, that of the verdict {least:.3g}"
    part = f"{max(share, 0.0):.1%}" if math.isfinite(share) else ""
    if found.cost <= best.cost or part == "100.0%":
        more = len(found.free) - len(best.free)
        words = f"more parameters ({more})" if more > 0 else "a larger BIC"
        return f"explains as much, but with {words}: {left}"
    if not part:
        return f"explains less: {left}"
    part = {"0.0%": "none"}.get(part, part)
    return f"explains {part} of what the verdict explains: {left}"


def _name(trial: Trial) -> str:
    return "+".join(_terms(trial)) or "none"


def _terms(trial: Trial) -> tuple[str, ...]:
    return tuple(sorted(trial.names))
