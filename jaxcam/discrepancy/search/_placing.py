"""Find the edge, knee or speed at which a term would have the largest gain."""

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...fitting import Problem
from ...fitting.engine import invert_information
from ..policy import Policy
from ..terms import Term
from ._local_force import force_blocks, Response


# Number of strengths evaluated at once
_TOGETHER = 36


class Placing(NamedTuple):
    """The values of a term's inner parameters with the largest gain, and this
    `gain`.
    """

    gain: float
    inner: Mapping[str, float]


def placing(
    problem: Problem, response: Response, term: Term, policy: Policy
) -> Placing:
    """Return the best starting values of a term that acts on the first coordinate.

    This uses the quadratic likelihood about a fit, with strengths of the permitted
    sign.

    **Arguments:** the problem, and its `Response` about the fit.
    """
    strengths = term.strengths()
    linear = np.array([k for k, one in enumerate(strengths) if not one.inner])
    low = np.array([strengths[k].lower for k in linear])
    high = np.array([strengths[k].upper for k in linear])
    size, count = len(response.prior), len(strengths)
    starts = term.starts()
    together = max(1, _TOGETHER // count)
    best = Placing(0.0, starts[0])
    for first in range(0, len(starts), together):
        some = starts[first : first + together]
        # padded to the same number each time, so that one program suffices
        filled = [*some, *[some[-1]] * (together - len(some))]
        copies = [dataclasses.replace(term, **start) for start in filled]
        blocks = force_blocks(problem, response, copies)
        information, score = blocks.total()
        for k, start in enumerate(some):
            own = size + k * count + linear
            rest, left = _beside(information, score, np.arange(size), own)
            grown = _signed_gain(rest, left, low, high, policy.distinct_information)
            if grown > best.gain:
                best = Placing(grown, start)
    return best


def _beside(information, score, free, new):
    """Return information and score of some strengths, with the free parameters
    eliminated.

    Strengths are scaled so that the information on each is one.
    """
    free = free[np.diag(information)[free] > 0]
    inside = invert_information(information[np.ix_(free, free)])
    across = information[np.ix_(new, free)]
    rest = information[np.ix_(new, new)] - across @ inside @ across.T
    left = score[new] - across @ (inside @ score[free])
    own = np.diag(information)[new]
    scale = 1 / np.sqrt(np.where(own > 0, own, np.inf))
    return rest * np.outer(scale, scale), left * scale


def _signed_gain(rest, left, low, high, alike: float) -> float:
    """Return the gain in twice the log-likelihood with strengths of the permitted sign.

    Strengths whose optimum has the wrong sign stay at zero.
    """
    open_ = [k for k in range(len(left)) if rest[k, k] > alike]
    while len(open_):
        pick = np.array(open_)
        values, vectors = np.linalg.eigh(rest[np.ix_(pick, pick)])
        seen = values > alike
        along = vectors[:, seen].T @ left[pick]
        step = vectors[:, seen] @ (along / values[seen])
        wrong = ((low[pick] >= 0) & (step < 0)) | ((high[pick] <= 0) & (step > 0))
        if not np.any(wrong):
            return float(step @ left[pick])
        open_ = [k for k, out in zip(open_, wrong) if not out]
    return 0.0
