"""Which functions and terms may be left out of a fit."""

import types
from typing import Any

import numpy as np
import pytest

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.search._blocks import _usable, moved
from jaxcam.discrepancy.search._gains import distinct_step, newton_step
from jaxcam.discrepancy.search._left_out import LeftOut
from jaxcam.discrepancy.search._unexplained import completes, parts_lacking


def _found(functions, cost, samples=1000, score=None, names=frozenset()):
    problem = types.SimpleNamespace(samples=samples)
    return types.SimpleNamespace(
        functions=tuple(types.SimpleNamespace(slot=one) for one in functions),
        names=names,
        fit=types.SimpleNamespace(cost=cost, problem=problem),
        problem=problem,
        score=cost if score is None else score,
    )


@pytest.mark.parametrize(
    "left, rest, needed",
    [
        # a fit to the noise needs nothing
        (1000.0, 990.0, False),
        # only the fit with all of them leaves noise
        (1500.0, 1000.0, True),
        # if the fit is poor, they must explain half of what remains
        (100_000.0, 20_000.0, True),
        (100_000.0, 60_000.0, False),
        # if the fit is good, an imperfect form may leave as much
        (3000.0, 1900.0, False),
    ],
)
def test_functions_that_explain_most_of_the_rest_are_kept(
    left, rest, needed, unchecked_types
):
    fits: Any = types.SimpleNamespace(policy=Policy())
    fewer, whole = _found(["a"], left), _found(["a", "b"], rest)
    assert parts_lacking(fits, fewer, fewer, whole) is needed
    assert not parts_lacking(fits, whole, whole, whole)
    # a formula that consists of a term and a form does not replace another function
    both = _found(["a", "c"], left)
    assert parts_lacking(fits, fewer, both, whole) is needed


@pytest.mark.parametrize(
    "left, rest, names, complete",
    [
        # a term that leaves only noise explains all, however small it is
        (1300.0, 1000.0, {"drag"}, True),
        # if the functions leave only noise themselves, nothing is left to explain
        (1005.0, 1000.0, {"drag"}, False),
        # more than noise remains
        (3000.0, 1200.0, {"drag"}, False),
        # another function may only represent an error of the first
        (1300.0, 1000.0, set(), False),
        # with several, each must explain enough
        (1300.0, 1000.0, {"drag", "lag"}, False),
    ],
)
def test_a_small_term_is_named_if_it_explains_all_that_is_left(
    left, rest, names, complete, unchecked_types
):
    fits: Any = types.SimpleNamespace(policy=Policy())
    found = _found(["a"], left)
    more = _found(["a"], rest, names=frozenset(names))
    assert completes(fits, found, more) is complete


def test_a_function_that_explains_much_is_not_fitted_without(
    monkeypatch, unchecked_types
):
    """The quadratic likelihood predicts a loss of more than ten times what is
    allowed for `a`; `b` is not needed."""
    tried = []

    def fitted(subset, point, beaten):
        tried.append((subset, beaten))
        return _found(["a"], 1010.0)

    one = object.__new__(LeftOut)
    one.policy, one.fits = Policy(), types.SimpleNamespace(fitted=fitted)
    losses = {"a": 5000.0, "b": 10.0}
    monkeypatch.setattr(
        LeftOut, "predicted_loss", lambda self, found, out: losses[out.slot]
    )
    monkeypatch.setattr(LeftOut, "subset", lambda self, found, out: (out.slot, None))
    whole = _found(["a", "b"], 1000.0)
    found = one.pruned(whole, lambda found: 100.0)
    # a fit that costs more than is allowed for need not be finished
    assert tried == [("b", whole.score + 100.0)] and len(found.functions) == 1


def test_a_diverging_motion_has_no_information():
    """Otherwise its eigenvalues are sought in vain."""
    one = np.ones((2, 2))
    assert _usable(one, one[0])
    for wrong in (np.inf, np.nan, 1e200):
        assert not _usable(one * wrong, one[0])
        assert not _usable(one, one[0] * wrong)


def test_information_that_is_not_positive_is_a_numerical_error():
    """Eigenvalues 3 and -1; a negative one of 1e-9 is a rounding error."""
    score = np.ones(2)
    assert not _usable(np.array([[1.0, 2.0], [2.0, 1.0]]), score)
    assert _usable(np.array([[1.0, 0.0], [0.0, -1e-9]]), score)


def test_a_replacement_starts_at_the_optimum_of_what_the_data_determine():
    """A Newton step to 1e-9; along two columns that are equal to 1e-6, only their sum
    moves.
    """
    rng = np.random.default_rng(0)
    design = rng.standard_normal((50, 4)) * np.array([1.0, 1e3, 1e-3, 1.0])
    rows, pull = np.array([0, 1, 3]), rng.standard_normal(50)
    information, score = design.T @ design, design.T @ pull
    wanted, _ = newton_step(information, score, rows)
    found = distinct_step(information, score, rows, 1e-8)
    np.testing.assert_allclose(found, wanted, rtol=1e-9)

    design[:, 3] = design[:, 0] + 1e-6 * rng.standard_normal(50)
    information, score = design.T @ design, design.T @ pull
    alone, _ = newton_step(information, score, rows[:2])
    found = distinct_step(information, score, rows, 1e-8)
    np.testing.assert_allclose(found[0] + found[2], alone[0], rtol=1e-4)
    np.testing.assert_allclose(found[0], found[2], rtol=1e-4)


@pytest.mark.usefixtures("unchecked_types")
def test_a_step_moves_shared_values_in_all_recordings():
    """And a value that each recording has of its own in this recording only."""
    problem: Any = types.SimpleNamespace(names=("a", "b"))
    blocks: Any = types.SimpleNamespace(
        names=("a", "b", "b"),
        owner=np.array([0, 0, 1]),
        scale=np.array([2.0, 1.0, 3.0]),
    )
    values: Any = np.array([[1.0, 10.0], [1.0, 20.0]])
    after = moved(problem, blocks, values, np.array([0, 2]), np.array([0.5, 1.0]))
    assert np.array_equal(after, [[2.0, 10.0], [2.0, 23.0]])


@pytest.mark.parametrize(
    ("worse", "share", "named"),
    [(20.0, 1e-3, True), (20.0, 0.0, False), (2e3, 1e-3, False)],
)
def test_a_term_replaces_a_function_if_it_explains_nearly_as_much(
    worse, share, named, monkeypatch, unchecked_types
):
    """A share of 1e-3 of an explained cost of 1e6 may be lost; and a term that was
    found is not replaced by another at a loss, or both would take turns.
    """
    policy = Policy()
    found = _found(["a", "b"], 1000.0)

    def fitted(subset, point, beaten):
        slots = [one.slot for one in subset.functions]
        cost = 1000.0 + worse * len(subset.names)
        trial = _found(slots, cost, names=subset.names)
        trial.fit.point = point
        return trial

    fits = types.SimpleNamespace(fitted=fitted, policy=policy)
    left_out = LeftOut(fits, (), None, policy)  # pyright: ignore

    def subset(found, out):
        kept = [one for one in found.functions if one is not out]
        names = found.names - {out} if isinstance(out, str) else found.names
        return types.SimpleNamespace(functions=kept, names=names), None

    def replacement(found, out, most):
        if not isinstance(out, str) and out.slot != "a":
            return None
        return ("friction" if "drag" in found.names else "drag"), None

    monkeypatch.setattr(left_out, "subset", subset)
    monkeypatch.setattr(left_out, "replacement", replacement)
    given: Any = found, (None,), lambda _: policy.small * 1e6, lambda *_: None
    after = left_out.swapped(*given, share)
    assert after.names == ({"drag"} if named else frozenset())
