"""Starts that cannot be, also where their values are not known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import simulate
from jaxcam.hybrid import flow, RESULTS, stroboscope
from jaxcam.hybrid.codes import (
    BACKWARD,
    BEHIND,
    FINISHED,
    message,
    NOT_FINITE,
    RUNNING,
)
from jaxcam.models import BouncingBall
from jaxcam.sweeps.attractors._label import label, OUTSIDE
from jaxcam.sweeps.sections._samples import Samples


_BALL = BouncingBall(restitution=0.7)
# state, t0, t1, code; the last is behind by less than 1e-12 of g / frequency^2
_STARTS = (
    ([1.0, 0.0], 0.0, 1.0, FINISHED),
    ([-0.5, 0.0], 0.0, 1.0, BEHIND),
    ([-3e-11, 0.0], 0.0, 1.0, BEHIND),
    ([np.nan, 0.0], 0.0, 1.0, NOT_FINITE),
    ([1.0, np.inf], 0.0, 1.0, NOT_FINITE),
    ([1.0, 0.0], 0.0, np.nan, NOT_FINITE),
    ([1.0, 0.0], 1.0, 0.5, BACKWARD),
    ([-9e-13, 0.0], 0.0, 1.0, FINISHED),
)


def _trajectory(state, t0, t1):
    made = simulate(_BALL, state, t0, t1, max_steps=256)
    return made.code, made.final, made.at(t0[None])[0], made.impacts.count


def _arrival(state, t0, t1):
    made = flow(_BALL, state, t0, t1, max_steps=256)
    return made.code, made.state, made.state, made.impacts


@pytest.mark.parametrize(
    "run", [pytest.param(_trajectory, marks=pytest.mark.slow), _arrival]
)
def test_starts_that_cannot_be_have_a_code_and_nan(run):
    """In a batch, next to lanes that are not affected: bit for bit as without them."""
    states, t0, t1, codes = (jnp.asarray(part) for part in zip(*_STARTS, strict=True))
    batch = jax.jit(jax.vmap(run))
    code, final, first, count = batch(states, t0, t1)
    np.testing.assert_array_equal(code, codes)
    good = np.asarray(codes) == FINISHED
    assert np.all(np.isfinite(np.asarray(final)[good]))
    assert np.all(np.isnan(np.asarray(final)[~good]))
    assert np.all(np.isnan(np.asarray(first)[~good]))
    assert np.all(np.asarray(count)[~good] == 0)
    alone = batch(*(jnp.tile(part[:1], (8, *[1] * (part.ndim - 1))) for part in
                    (states, t0, t1)))  # fmt: skip
    np.testing.assert_array_equal(final[0], alone[1][0])
    # under a derivative as well
    slope = jax.jit(jax.vmap(jax.jacfwd(lambda *a: run(*a)[1])))(states, t0, t1)
    assert np.all(np.isfinite(np.asarray(slope)[good]))
    assert not np.any(np.isfinite(np.asarray(final + slope[..., 0])[~good]))


@pytest.mark.parametrize("state, t0, t1, code", _STARTS)
def test_known_values_are_refused_alike(state, t0, t1, code):
    """What has a code of its own when traced raises `ValueError` when it is not."""
    if code == FINISHED:
        assert simulate(_BALL, state, t0, t1).successful
        return
    with pytest.raises(ValueError):
        simulate(_BALL, state, t0, t1)


def test_batches_of_sweeps_refuse_by_the_same_rule():
    """A far lane does not loosen the check of the others."""
    good = np.array([[1e3, 0.0], [-9e-13, 0.0]])
    assert np.all(stroboscope(_BALL, good, 1, period=0.1).code == FINISHED)
    with pytest.raises(ValueError, match="gap is negative .* in trajectory 1"):
        stroboscope(_BALL, np.array([[1e3, 0.0], [-1e-10, 0.0]]), 1, period=0.1)


def test_each_code_is_a_sentence():
    items = [RESULTS.successful, RESULTS.running, RESULTS.step_failed]
    items += [RESULTS.not_finite, RESULTS.behind, RESULTS.backward, RESULTS.together]
    assert [message(k) for k in range(len(items))] == [RESULTS[i] for i in items]
    assert [RESULTS[np.int32(k)] for k in range(len(items))] == [
        RESULTS[i] for i in items
    ]
    assert RESULTS[jnp.asarray(1)] == RESULTS[RESULTS.running]
    assert FINISHED == 0 and message(int(RUNNING)) == RESULTS[RESULTS.running]
    sentences = [message(k) for k in range(1, len(items))]
    assert all(len(s) > 20 and s.endswith(".") for s in sentences)


def test_label_of_a_start_behind_the_constraint():
    none = np.zeros((1, 2), dtype=int)
    samples = Samples(
        states=np.full((1, 2, 2), np.nan),
        times=np.full((1, 2), np.nan),
        hits=none,
        rests=none,
        final=np.full((1, 2), np.nan),
        contact=np.zeros(1, dtype=bool),
        code=np.array([int(BEHIND)]),
    )
    assert label(samples).turns[0] == OUTSIDE
