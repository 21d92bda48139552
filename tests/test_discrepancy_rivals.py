"""Rival functions, forms with sharp edges, and decoys."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks._made_rigs import made_rig
from benchmarks.unnamed import hidden_case, judged
from jaxcam.discrepancy import diagnose, Policy
from jaxcam.discrepancy.evidence import _rivals, _unnamed
from jaxcam.discrepancy.search import Missing, Shuffled
from jaxcam.discrepancy.search._local_force import _in_reverse, Response
from jaxcam.discrepancy.search._shuffled import _at_other_moments
from jaxcam.discrepancy.terms import Place
from jaxcam.discrepancy.terms._primitives import PRIMITIVES


@pytest.mark.parametrize("primitive", PRIMITIVES, ids=lambda one: one.name)
def test_a_form_is_the_same_in_numpy_and_in_jax(primitive):
    """To rounding: the search ranks forms in numpy, a fit evaluates them in JAX."""
    x = np.linspace(-0.4, 1.1, 101)
    numbers = np.array([0.7, *(one[len(one) // 2] for one in primitive.starts)])
    direction = np.tanh(x / 1e-3)
    plain = primitive.value(Place.between(x, -0.4, 1.1), numbers, direction)
    traced = primitive.value(
        Place.between(jnp.asarray(x), -0.4, 1.1),
        jnp.asarray(numbers),
        jnp.asarray(direction),
    )
    assert isinstance(plain, np.ndarray)
    np.testing.assert_allclose(traced, plain, rtol=1e-12, atol=1e-14)


def test_a_decoy_acts_in_the_reverse_order_of_time():
    """Only the pieces that exist are exchanged, within their own recording."""
    exists = np.array([[True, True, True, False], [True, False, True, True]])
    response = Response(*([None] * len(Response._fields)))._replace(exists=exists)
    forces = np.arange(2 * 4 * 3 * 1, dtype=float).reshape(2, 4, 3, 1)
    found = _in_reverse(response, forces)
    for row, seen in enumerate(exists):
        before, after = forces[row, seen].ravel(), found[row, seen].ravel()
        np.testing.assert_array_equal(after, before[::-1])
        np.testing.assert_array_equal(found[row, ~seen], forces[row, ~seen])


def test_a_knockoff_acts_at_other_moments_of_its_recording():
    """At least a tenth of the recording away, counted around its ends; padding is left
    as it is, also in a recording without flights, and two knockoffs differ."""
    exists = np.array([[True] * 40, [True, False] * 20, [False] * 40])
    response = Response(*([None] * len(Response._fields)))._replace(exists=exists)
    forces = np.arange(3 * 40 * 5, dtype=float).reshape(3, 40, 5, 1)
    rng = np.random.default_rng(3)
    one, other = (_at_other_moments(response, forces, rng) for _ in range(2))
    assert np.any(one != other)
    for row, seen in enumerate(exists):
        np.testing.assert_array_equal(one[row, ~seen], forces[row, ~seen])
        own = forces[row, seen].ravel()
        taken = np.searchsorted(own, one[row, seen].ravel())
        np.testing.assert_array_equal(own[taken], one[row, seen].ravel())
        shift = (taken - np.arange(len(own))) % len(own)
        assert np.all((shift >= 0.1 * len(own)) & (shift <= 0.9 * len(own)))


@pytest.mark.parametrize(("share", "kept"), [(0.99, True), (1.01, False)])
def test_a_force_that_a_knockoff_equals_is_not_reported(
    share, kept, monkeypatch, unchecked_types
):
    """The force is kept if the best knockoff explains less than the force, 99 %."""
    compared = (Shuffled("flight time", ("time",), (share, 0.2)),)
    inclusion = SimpleNamespace(inclusion={"flight time": 1.0})
    monkeypatch.setattr(_unnamed, "needs", lambda *_, **__: inclusion)
    fits = SimpleNamespace(
        parts=lambda _: {"flight time": []},
        prices=lambda _: {},
        polished=lambda one: one,
    )
    search = SimpleNamespace(
        policy=Policy(), fits=fits, first=(), shuffled=lambda *_: compared
    )
    fitted = SimpleNamespace(problem=None, free=())
    part = SimpleNamespace(label="flight time")
    found = Missing((part,), frozenset(), fitted, 1.0, None)  # pyright: ignore
    chance = []
    left, _ = _unnamed._needed(search, found, 2.0, 0, chance)  # pyright: ignore
    assert (left is not None and left.shuffled == compared) is kept
    assert tuple(chance) == (() if kept else compared)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "effect"), [("two_stops", "pulse"), ("stage", "fast_drag")]
)
def test_a_sharp_edge_is_found_behind_a_smooth_rival(rig, effect):
    """Kind and variables right, nine tenths of the squared error gone, the function
    within 0.4 of its rms (see `benchmarks.unnamed`)."""
    made = made_rig(rig)
    hidden, runs, motions, _ = hidden_case(made, effect, 0)
    right, why = judged(diagnose(made.given, runs), hidden, motions)
    assert right, why


def test_the_choice_with_an_additional_term_is_no_rival(monkeypatch, unchecked_types):
    """Another function is one, even with a larger score."""
    monkeypatch.setattr(_rivals, "_costs", lambda fit, policy: np.ones(4))

    def fitted(label, score, names=()):
        part = SimpleNamespace(label=label, primitive=None)
        return SimpleNamespace(
            functions=(part,), names=frozenset(names), fit=None, score=score
        )

    found = fitted("flight velocity", 10.0)
    nested = fitted("flight velocity", 9.0, {"sensor_lag"})
    other = fitted("flight position", 12.0)
    kept = _rivals.rivals(found, [nested, other, found], Policy(), 0)
    assert [one.missing for one in kept] == [other]


@pytest.mark.parametrize(
    ("before", "functions", "named", "dropped"),
    [
        # the functions explain most of what is left: no other prediction is needed
        (10.0, 4.0, None, False),
        # both are poor, and the named terms are better
        (1.5, 1.2, 1.1, True),
        (1.5, 1.2, 1.3, False),
        # most of the squared residual above the noise remains
        (10.0, 9.0, 9.5, True),
        # the textbook model leaves only noise
        (1.001, 1.001, 1.001, False),
    ],
)
def test_functions_must_predict_held_out_data(
    before, functions, named, dropped, monkeypatch, unchecked_types
):
    """Held-out rms residuals of 10 000 samples, in units of the noise."""
    of_terms = SimpleNamespace(after=named)
    monkeypatch.setattr(_unnamed, "held_out", lambda trials, before, best: of_terms)
    trials = SimpleNamespace(policy=Policy())
    problem = SimpleNamespace(samples=10_000)
    missing = SimpleNamespace(fit=SimpleNamespace(problem=problem))
    held = SimpleNamespace(before=before, after=functions)
    best = SimpleNamespace(names=frozenset({"quadratic_drag"}))
    found = _unnamed.rejected(trials, missing, held, None, best)
    assert (found is not None) == dropped
    if found is not None:
        assert found.named is of_terms and found.functions is missing
    # without named terms, only what the functions themselves predict counts
    best.names = frozenset()
    found = _unnamed.rejected(trials, missing, held, None, best)
    assert (found is not None) == (before == 10.0 and dropped)
