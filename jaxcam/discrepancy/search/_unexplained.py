"""What a fit leaves unexplained."""

import math

from ._free_fits import FreeFits, Missing
from ._heat import heat_of


def leaves_noise(fits: FreeFits, found: Missing, small: float = 0.0) -> bool:
    """Return whether the cost of a fit is no larger than the noise explains.

    **Arguments:** `small`: the tolerated residual; a fraction
    `Policy.negligible_residual` of it is treated as noise.
    """
    samples = found.problem.samples
    surplus = fits.policy.cost_errors * math.sqrt(2 * samples)
    return found.fit.cost < samples + max(
        surplus, fits.policy.negligible_residual * small
    )


def parts_lacking(
    fits: FreeFits, curve: Missing, found: Missing, whole: Missing
) -> bool:
    """Return whether functions or terms that the `curve` leaves out are needed, in
    spite of the formulas `found`: only the `whole` fit leaves nothing but noise, or the
    fit is poor and they explain most of what remains.
    """
    few, many = (len(one.functions) + len(one.names) for one in (curve, whole))
    if few == many or leaves_noise(fits, found):
        return False
    if leaves_noise(fits, whole):
        return True
    samples, policy = found.problem.samples, fits.policy
    left, rest = found.fit.cost - samples, whole.fit.cost - samples
    return heat_of(found.fit) > policy.near_cost and rest < policy.explains * left


def completes(fits: FreeFits, found: Missing, more: Missing) -> bool:
    """Return whether a single term in addition to a fit explains all that its functions
    leave, however little that is.
    """
    added = len(more.names - found.names), len(more.functions) - len(found.functions)
    if added != (1, 0):
        return False
    if leaves_noise(fits, found) or not leaves_noise(fits, more):
        return False
    left, rest = (one.fit.cost - one.problem.samples for one in (found, more))
    return rest < fits.policy.negligible_residual * left


def completing_gain(fits: FreeFits, found: Missing) -> float:
    """Return the least predicted gain of a term that may explain all that is left;
    infinite if nothing but noise is left.
    """
    if leaves_noise(fits, found):
        return math.inf
    left = found.fit.cost - found.problem.samples
    return fits.policy.promising * left / heat_of(found.fit)
