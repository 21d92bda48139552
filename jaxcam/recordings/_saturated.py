"""Find the samples of a channel at the limit of its sensor."""

import numpy as np
from jaxtyping import Bool, Float


# Number and fraction of samples that may have the largest magnitude by chance
_FEW, _RARE = 3, 0.002


def saturated(samples: Float[np.ndarray, " k"]) -> Bool[np.ndarray, " k"]:
    """Return the samples with the largest magnitude, or none of them if there are only
    a few, as without a limit.
    """
    size = np.abs(samples)
    at_limit = size >= np.max(size) * (1 - 1e-9)
    many = np.sum(at_limit) > max(_FEW, _RARE * len(size))
    return at_limit & many
