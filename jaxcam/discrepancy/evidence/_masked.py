"""Drop terms that only compensate for the smoothed corner of another term."""

from ..search import Trial, Trials


def unmasked(trials: Trials, best: Trial) -> tuple[Trial, list[tuple[str, float]]]:
    """Return a subset without the terms that may only represent the error of a smoothed
    corner.

    Dry friction jumps when the velocity changes sign. The jump is smoothed, and
    integration steps do not end there, so the term may leave a small fraction of the
    cost that it should explain. With many samples this fraction is significant, and
    another term may represent it.

    **Returns:** the fit, and the dropped terms, each with its fraction of the explained
    cost.
    """
    dropped: list[tuple[str, float]] = []
    bare = trials.known[frozenset()]
    while any(trials.term(name).corner for name in best.names):
        explained = bare.fit.cost - best.fit.cost
        shares = {
            name: (trials.without(best, name).fit.cost - best.fit.cost) / explained
            for name in best.names
            if not trials.term(name).corner
        }
        least = min(shares, key=lambda name: shares[name], default=None)
        if least is None or shares[least] >= trials.policy.corner_share:
            break
        dropped.append((least, shares[least]))
        best = trials.without(best, least)
    return best, dropped
