"""Fit parameters to published values instead of recordings."""

from ._free_fall import fit_free_fall as fit_free_fall, FreeFall as FreeFall
from ._interruption_point import (
    interruption_of_chattering as interruption_of_chattering,
)
from ._published import (
    fit_published as fit_published,
    Published as Published,
    rounding_error as rounding_error,
)
from ._published_fit import PublishedFit as PublishedFit
