"""A term that only imitates a stronger effect, with quadratic likelihoods."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.evidence._imitation import beside_structure
from jaxcam.discrepancy.evidence._supported import _imitating
from jaxcam.discrepancy.search import Blocks


POLICY = Policy()


def _fitted(truth):
    """The likelihood of a parameter of the rig, a term and a structure about the fit of
    the first two to 400 samples of unit noise, and the gain of the structure.

    The regressors of term and structure have a correlation of 0.6; `truth` states the
    values of all three.
    """
    rng = np.random.default_rng(3)
    rig, one, other = rng.normal(size=(3, 400))
    design = np.stack([rig, 0.6 * other + 0.8 * one, other], axis=1)
    seen = design @ np.array(truth) + rng.normal(size=400)
    value = np.append(np.linalg.lstsq(design[:, :2], seen, rcond=None)[0], 0.0)
    information, score = design.T @ design, design.T @ (seen - design @ value)
    none = np.zeros(3)
    blocks = Blocks(
        ("rig", "term", "shape"),
        np.ones(3),
        ("run",),
        np.zeros(1),
        information[None],
        score[None],
        none,
        none,
        np.zeros(3, int),
    )
    found = SimpleNamespace(
        problem=SimpleNamespace(names=("rig", "term")),
        point=SimpleNamespace(values=value[None, :2]),
    )
    rest = seen - design @ np.linalg.lstsq(design, seen, rcond=None)[0]
    left = seen - design[:, :2] @ value[:2]
    gain = float(left @ left - rest @ rest)
    free, own = np.array([0, 1]), np.array([2])
    named = beside_structure(found, blocks, free, own, {"term": ["term"]})
    without = np.linalg.lstsq(design[:, [0, 2]], seen, rcond=None)[0]
    lost = seen - design[:, [0, 2]] @ without
    assert named["term"].beside == pytest.approx(lost @ lost - rest @ rest, rel=1e-6)
    structure = SimpleNamespace(
        significant=True, named=named, gain=gain, sentence="a force"
    )
    return named["term"], _imitating([structure], POLICY)  # pyright: ignore


def test_a_term_that_imitates_a_stronger_effect_is_found(unchecked_types):
    """Of a structure alone, the term explains more than 100 in twice the log-likelihood
    (0.6 squared of 400 times 4), but less than 10 beside it."""
    named, wrong = _fitted([0.2, 0.0, 2.0])
    assert named.alone > 100 and named.beside < 10
    assert wrong == ("term", "a force")


def test_a_term_that_is_really_there_is_kept(unchecked_types):
    """The other effect is weaker or stronger than the term. Beside the stronger one,
    the term alone explains 8 % of the misfit, more than an error of its form may."""
    for size in (0.5, 3.0):
        named, wrong = _fitted([0.2, 1.5, size])
        assert named.beside > 100
        assert wrong is None
