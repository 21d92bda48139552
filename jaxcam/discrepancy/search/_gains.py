"""Compute the gain of freeing parameters, by a quadratic likelihood."""

import numpy as np

from ...fitting.engine import invert_information
from ..policy import Policy
from ._blocks import Blocks


def gain(information, score, rows) -> float:
    """Growth of twice the log-likelihood when some parameters are freed."""
    if not len(rows):
        return 0.0
    step, _ = newton_step(information, score, rows)
    return float(score[rows] @ step)


def added_gain(information, score, free, new, alike: float) -> float:
    """Growth of twice the log-likelihood when `new` are freed beside `free`.

    Combinations that the free ones imitate to within `alike` of their information gain
    nothing, as rounding would decide what.
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
    """Gain in twice the log-likelihood of records with what others say of `new`.

    They are dealt out to two halves, each predicts the other, and the sum is
    returned; the `free` parameters are fitted to either half. What differs from record
    to record, as the faults of a film do, gains where it is fitted and loses here.
    Infinite for one record, which can predict nothing.
    """
    names = list(dict.fromkeys(blocks.record))
    if len(names) < 2:
        return np.inf
    information, score = blocks.total()
    free = free[np.diag(information)[free] > 0]
    new = np.setdiff1d(new, free)
    rest, _ = _beside(information, score, free, new, np.eye(len(new)))
    own = np.diag(information)[new]
    scale = 1 / np.sqrt(np.where(own > 0, own, np.inf))
    values, vectors = np.linalg.eigh(rest * np.outer(scale, scale))
    seen = values > policy.alike
    # combinations that can be told from the free ones, each known to one unit
    basis = scale[:, None] * vectors[:, seen] / np.sqrt(values[seen])
    total = 0.0
    for half in (names[::2], names[1::2]):
        known = np.isin(blocks.record, half).astype(float)
        inside, pull = _beside(*blocks.total(known), free, new, basis)
        values, vectors = np.linalg.eigh(inside)
        told = values > policy.untold
        step = vectors[:, told] @ ((vectors[:, told].T @ pull) / values[told])
        inside, pull = _beside(*blocks.total(1 - known), free, new, basis)
        total += float(2 * step @ pull - step @ inside @ step)
    return total


def _beside(information, score, free, new, basis):
    """Information and score of combinations of `new`, the free ones eliminated."""
    free = free[np.diag(information)[free] > 0]
    inverse = invert_information(information[np.ix_(free, free)])
    across = basis.T @ information[np.ix_(new, free)]
    inside = basis.T @ information[np.ix_(new, new)] @ basis
    return (
        inside - across @ inverse @ across.T,
        basis.T @ score[new] - across @ (inverse @ score[free]),
    )


def newton_step(information, score, rows):
    """Steps of some parameters to their optimum, and their covariance.

    What the data do not see at all stays where it is, with an infinite variance.
    """
    step = np.zeros(len(rows))
    covariance = np.diag(np.full(len(rows), np.inf))
    alive = np.flatnonzero(np.diag(information)[rows] > 0)
    inside = rows[alive]
    inverse = invert_information(information[np.ix_(inside, inside)])
    step[alive] = inverse @ score[inside]
    covariance[np.ix_(alive, alive)] = inverse
    return step, covariance
