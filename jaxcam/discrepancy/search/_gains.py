"""Compute the gain of freeing parameters, by a quadratic likelihood."""

import numpy as np

from ...fitting.engine import invert_information
from ..policy import Policy
from ._blocks import Blocks


def gain(information, score, rows) -> float:
    """Return the increase in twice the log-likelihood when some parameters are
    freed.
    """
    if not len(rows):
        return 0.0
    step, _ = newton_step(information, score, rows)
    return float(score[rows] @ step)


def added_gain(information, score, free, new, alike: float) -> float:
    """Return the increase in twice the log-likelihood when the `new` parameters are
    freed in addition to the `free` ones.

    If the free parameters represent a combination of the new ones so well that less
    than a fraction `distinct_information` of the information on it remains, the gain of
    this combination is zero, because only rounding errors would be left.
    """
    new = np.setdiff1d(new, free)
    if not len(new):
        return 0.0
    free = free[np.diag(information)[free] > 0]
    inside = invert_information(information[np.ix_(free, free)])
    across = information[np.ix_(new, free)]
    rest = information[np.ix_(new, new)] - across @ inside @ across.T
    left = score[new] - across @ (inside @ score[free])
    own = np.diag(information)[new]
    scale = 1 / np.sqrt(np.where(own > 0, own, np.inf))
    values, vectors = np.linalg.eigh(rest * np.outer(scale, scale))
    along = vectors.T @ (left * scale)
    seen = values > alike
    return float(np.sum(along[seen] ** 2 / values[seen]))


def predicted_gain(blocks: Blocks, free, new, policy: Policy) -> float:
    """Return the gain in twice the log-likelihood of recordings when the `new`
    parameters are estimated from other recordings.

    The recordings are divided into two halves, each of which predicts the other, and
    the sum of the gains is returned; the `free` parameters are fitted to either half.
    An effect that differs from recording to recording, such as the distortion of a
    film, has a gain in the fit but a loss here. The gain is infinite for a single
    recording, which cannot be predicted.
    """
    names = list(dict.fromkeys(blocks.record))
    if len(names) < 2:
        return np.inf
    free, new, basis = _distinguished(blocks, free, new, policy)
    total = 0.0
    for half in (names[::2], names[1::2]):
        known = np.isin(blocks.record, half).astype(float)
        inside, pull = _beside(*blocks.total(known), free, new, basis)
        values, vectors = np.linalg.eigh(inside)
        told = values > policy.half_information
        step = vectors[:, told] @ ((vectors[:, told].T @ pull) / values[told])
        inside, pull = _beside(*blocks.total(1 - known), free, new, basis)
        total += float(2 * step @ pull - step @ inside @ step)
    return total


def separate_gain(blocks: Blocks, free, new, policy: Policy) -> tuple[float, int]:
    """Return the increase in twice the log-likelihood when each recording has its own
    values of the `new` parameters instead of common ones, and the number of additional
    parameters.

    If the values are common, the increase has a chi-squared distribution with this
    number of degrees of freedom. Combinations about which a recording contains too
    little information have no separate value there.
    """
    free, new, basis = _distinguished(blocks, free, new, policy)
    names = list(dict.fromkeys(blocks.record))
    each = [np.flatnonzero(np.array(blocks.record) == name) for name in names]

    def freed(groups) -> tuple[float, int]:
        """Free the parameters in each group of blocks, with the others common."""
        information, score = blocks.total()
        inside, slope = information[np.ix_(free, free)], score[free]
        total, count = 0.0, 0
        for group in groups:
            own = np.sum(blocks.information[group], axis=0)
            values, vectors = np.linalg.eigh(basis.T @ own[np.ix_(new, new)] @ basis)
            told = values > policy.half_information
            root = vectors[:, told] / np.sqrt(values[told])
            across = root.T @ basis.T @ own[np.ix_(new, free)]
            along = root.T @ basis.T @ np.sum(blocks.score[group], axis=0)[new]
            inside, slope = inside - across.T @ across, slope - across.T @ along
            total, count = total + float(along @ along), count + int(np.sum(told))
        return total + float(slope @ invert_information(inside) @ slope), count

    common, few = freed([np.arange(len(blocks.record))])
    separate, many = freed(each)
    return separate - common, many - few


def _distinguished(blocks: Blocks, free, new, policy: Policy):
    """Return the free and the new parameters, and the combinations of the new ones that
    can be distinguished from the free ones, each with unit information.
    """
    information, score = blocks.total()
    free = free[np.diag(information)[free] > 0]
    new = np.setdiff1d(new, free)
    rest, _ = _beside(information, score, free, new, np.eye(len(new)))
    own = np.diag(information)[new]
    scale = 1 / np.sqrt(np.where(own > 0, own, np.inf))
    values, vectors = np.linalg.eigh(rest * np.outer(scale, scale))
    seen = values > policy.distinct_information
    return free, new, scale[:, None] * vectors[:, seen] / np.sqrt(values[seen])


def _beside(information, score, free, new, basis):
    """Return information and score of combinations of the `new` parameters, with the
    `free` parameters eliminated.
    """
    free = free[np.diag(information)[free] > 0]
    inverse = invert_information(information[np.ix_(free, free)])
    across = basis.T @ information[np.ix_(new, free)]
    inside = basis.T @ information[np.ix_(new, new)] @ basis
    return (
        inside - across @ inverse @ across.T,
        basis.T @ score[new] - across @ (inverse @ score[free]),
    )


def distinct_step(information, score, rows, alike: float) -> np.ndarray:
    """Return the steps of some parameters to their optimum. Combinations on which the
    data contain less than a fraction `alike` of the information on their parts do not
    move.
    """
    own = np.diag(information)[rows]
    scale = np.where(own > 0, 1 / np.sqrt(np.where(own > 0, own, 1.0)), 0.0)
    inside = information[np.ix_(rows, rows)] * np.outer(scale, scale)
    values, vectors = np.linalg.eigh(inside)
    seen = values > alike
    along = vectors[:, seen].T @ (score[rows] * scale)
    return scale * (vectors[:, seen] @ (along / values[seen]))


def newton_step(information, score, rows):
    """Return the steps of some parameters to their optimum, and their covariance.

    A parameter about which the data contain no information does not move and has an
    infinite variance.
    """
    step = np.zeros(len(rows))
    covariance = np.diag(np.full(len(rows), np.inf))
    alive = np.flatnonzero(np.diag(information)[rows] > 0)
    inside = rows[alive]
    inverse = invert_information(information[np.ix_(inside, inside)])
    step[alive] = inverse @ score[inside]
    covariance[np.ix_(alive, alive)] = inverse
    return step, covariance
