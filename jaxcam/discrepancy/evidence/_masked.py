"""Terms that are no more than what a smoothed corner of another one leaves."""

from ..search import Trial, Trials


def unmasked(trials: Trials, best: Trial) -> tuple[Trial, list[tuple[str, float]]]:
    """A subset without the terms that the integration of a corner explains as well.

    Dry friction jumps where the speed changes sign. Its form is smooth, and steps do
    not end there, so that a small share of what it explains may be left over; many
    samples make this share significant, and some other term takes it up.

    **Returns:** the fit, and the terms that were dropped, each with the share of what
    is explained that it had.
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
