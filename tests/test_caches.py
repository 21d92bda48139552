"""What is traced and compiled once, and how it is forgotten."""

import gc

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcam
from jaxcam.hybrid import flow, HybridSystem
from jaxcam.hybrid.caches import _Collector, Cache


def field(rate):
    def vector_field(self, t, state):
        return jnp.stack([state[1], rate * jnp.ones(())])

    return vector_field


def falling(rate):
    """A new class of point masses, far above a floor."""

    class Falling(HybridSystem):
        vector_field = field(rate)

        def gap(self, t, state):
            return state[0]

        def impact(self, t, state):
            return jnp.stack([state[0], -state[1]])

    return Falling


START = [10.0, 0.0]


def test_a_replaced_method_takes_effect_after_clearing():
    """The first call keeps the old one, as all compiled programs do."""
    kind = falling(-1.0)
    one = jaxcam.simulate(kind(), START, 0.0, 1.0)
    kind.vector_field = field(-2.0)
    jaxcam.clear_caches()
    two = jaxcam.simulate(kind(), START, 0.0, 1.0)
    assert float(one.final[1]) == pytest.approx(-1.0)
    assert float(two.final[1]) == pytest.approx(-2.0)
    assert float(two.at([0.5])[0, 1]) == pytest.approx(-1.0)


def test_a_new_trace_sees_a_replaced_method():
    kind = falling(-1.0)
    jaxcam.simulate(kind(), START, 0.0, 1.0)
    kind.vector_field = field(-2.0)
    end = jax.jit(lambda x: flow(kind(), x, 0.0, 1.0).state)(jnp.array(START))
    assert float(end[1]) == pytest.approx(-2.0)


def test_a_cache_forgets_the_oldest():
    cache = Cache(2)
    made = [cache.get(key, lambda key=key: [key]) for key in "abc"]
    assert cache.get("c", list) is made[2]
    assert cache.get("a", lambda: "again") == "again"
    assert cache.get("d", lambda: "not kept", lambda made: False) == "not kept"
    assert cache.get("d", lambda: "kept") == "kept"
    cache.clear()
    assert cache.get("c", lambda: "new") == "new"


class Broken(HybridSystem):
    """A mistake of the user is reported as such."""

    def vector_field(self, t, state):
        return jnp.stack([state[1], -state[0]])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -state[1]]) + jnp.zeros(3)


def test_a_mistake_in_a_system_is_not_hidden():
    with pytest.raises((TypeError, ValueError), match="shape"):
        jaxcam.simulate(Broken(), [1.0, 0.0], 0.0, 0.5)


class Loaded(HybridSystem):
    """A ball whose acceleration is kept in an object that can be changed in place."""

    load: list | np.ndarray

    def vector_field(self, t, x):
        return jnp.stack([x[1], -jnp.asarray(self.load)[0]])

    def gap(self, t, x):
        return x[0]

    def impact(self, t, x):
        return jnp.stack([x[0], -x[1]])


@pytest.mark.parametrize("kind", [list, np.array])
def test_a_parameter_changed_in_place_is_seen_by_the_next_run(kind):
    # height after 0.1 s of free fall from 1 m, exact to 1e-12
    ball = Loaded(kind([9.81]))
    for load in (9.81, 2.0):
        ball.load[0] = load
        run = jaxcam.simulate(ball, [1.0, 0.0], 0.0, 0.1)
        assert float(run.final[0]) == pytest.approx(1 - load / 200, abs=1e-12)


def test_a_parameter_changed_in_place_is_checked_again():
    ball = Loaded([9.81])
    jaxcam.simulate(ball, [1.0, 0.0], 0.0, 0.1)
    ball.load[0] = float("nan")
    with pytest.raises(ValueError, match="not finite"):
        jaxcam.simulate(ball, [1.0, 0.0], 0.0, 0.1)


def test_the_garbage_collector_resumes_after_the_last_of_several_threads():
    """Also if the thread that suspended it first ends first, and if a trace fails."""
    collector = _Collector()
    first, second = collector.suspended(), collector.suspended()
    first.__enter__(), second.__enter__()
    first.__exit__(None, None, None)
    assert not gc.isenabled()
    second.__exit__(None, None, None)
    assert gc.isenabled()
    with pytest.raises(ZeroDivisionError):
        Cache().get("key", lambda: 1 / 0)
    assert gc.isenabled()
