"""Seek missing physics at coordinates and gaps other than the first."""

import dataclasses
from collections.abc import Callable

from .evidence import above_noise
from .report import Diagnosis, Verdict
from .terms import EVERY, Location, other_locations, WithTerms


def falls_short(found: Diagnosis) -> bool:
    """Return whether a diagnosis leaves a residual above the noise unexplained."""
    separate = found.differing
    if found.verdict is Verdict.NONE or (separate is not None and separate.complete):
        return False
    samples, left = found.after.problem.samples, found.after.cost
    explained = found.before.cost - left
    if (
        found.verdict is Verdict.EFFECT
        and left - samples < found.policy.small * explained
    ):
        # an error of the form of the named terms may leave as much
        return False
    return above_noise(left, samples, found.policy)


def law_elsewhere(found: Diagnosis) -> bool:
    """Return whether an unnamed law of restitution was found at a gap other than the
    first. The library has such laws, but they were sought at the first gap alone.
    """
    return bool(_suggested(found))


def _suggested(found: Diagnosis) -> list[Location]:
    """Return the location of the unnamed laws of restitution, if it is not the first
    gap alone: all gaps if there are several laws.
    """
    problem = found.after.problem
    laws = {
        one.gap
        for one in found.missing
        if one.kind == "restitution" and one.arguments == ("speed",)
    }
    if len(laws) > 1:
        return [Location(constraint=EVERY)]
    name = problem.model.system.constraint_name
    return [
        one
        for one in other_locations(problem)
        if one.constraint > 0 and name(one.constraint) in laws
    ]


def _left(found: Diagnosis) -> float:
    """Return the part of the cost that exceeds the cost of noise alone, multiplied by
    the variance of the noise, which may be larger if model errors are allowed for.
    """
    excess = max(found.after.cost - found.after.problem.samples, 0.0)
    return excess * found.noise_floor**2


def _explains(other: Diagnosis, best: Diagnosis) -> bool:
    """Return whether a diagnosis at another location is preferred to the best so far:
    it leaves much less, or it names what the other one does not.
    """
    allowed = best.policy.elsewhere * _left(best)
    if other.verdict is Verdict.EFFECT and best.verdict is Verdict.UNKNOWN:
        explained = (best.before.cost - best.after.cost) * best.noise_floor**2
        allowed = max(allowed, best.policy.small * explained)
    return _left(other) < allowed


def sought_elsewhere(
    found: Diagnosis, asked: Callable[[Location], Diagnosis], library: bool = True
) -> Diagnosis:
    """Return the diagnosis at the location where the missing physics explains most.

    **Arguments:** the diagnosis at the first coordinate and gap, which leaves part of
    the residual unexplained; a function that diagnoses at a given location; and whether
    the terms are those of the library, which can act at any gap.
    """
    problem = found.after.problem
    system = problem.model.system
    assert isinstance(system, WithTerms)
    suggested = _suggested(found) if library else []
    others = [one for one in other_locations(problem) if one.coordinate or library]
    locations = suggested + [one for one in others if one not in suggested]
    if not falls_short(found):
        locations = suggested
    best, where = found, Location()
    for location in locations[: found.policy.followed]:
        other = asked(location)
        if _explains(other, best):
            best, where = other, location
        if not falls_short(best):
            break
    if where == Location():
        return found
    first, then = (one.said(system, system.coordinates) for one in (Location(), where))
    gaps = {one.gap for one in best.missing}
    named = any(one.term for one in best.effects)
    if not named and not where.coordinate and gaps == {first[1]}:
        # functions at impacts are sought at several gaps, whatever the location
        return best
    kind, k = ("the coordinate", 0) if where.coordinate else ("the gap", 1)
    at = then[k] if where.constraint == EVERY else f"{kind} {then[k]}"
    sentence = (
        f"This effect acts at {at}: no effect at {first[k]} alone explains the "
        "recordings as well."
    )
    return dataclasses.replace(
        best, summary=f"{best.summary} {sentence}", location=then
    )
