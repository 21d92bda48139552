"""Bodies that come to rest together: impacts on two constraints accumulate."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from textbook_systems import BallBetweenWalls, parameters

import jaxcam
from jaxcam import HybridSystem
from jaxcam.hybrid import flow, RESULTS
from jaxcam.hybrid.codes import FINISHED, TOGETHER


class Stack(HybridSystem):
    """Bodies of masses 1 and `mass` above a floor, pushed down; state (x1, x2, v1, v2).

    The second lies on the first.
    """

    first: jax.Array
    second: jax.Array
    floor: jax.Array
    between: jax.Array
    mass: jax.Array

    def vector_field(self, t, state):
        return jnp.stack([state[2], state[3], -self.first, -self.second])

    def gap(self, t, state):
        return jnp.stack([state[0], state[1] - state[0]])

    def impact(self, t, state):
        push = -(1 + self.between) * (state[3] - state[2]) / (1 + 1 / self.mass)
        after = state.at[2].add(-push).at[3].add(push / self.mass)
        return jnp.stack([state.at[2].multiply(-self.floor), after])


def _random(seed, pulls):
    random = np.random.default_rng(seed)
    numbers = dict(
        first=random.uniform(*pulls[0]),
        second=random.uniform(*pulls[1]),
        floor=random.uniform(0.2, 0.9),
        between=random.uniform(0.2, 0.9),
        mass=random.uniform(0.2, 5.0),
    )
    low, high = random.uniform(0.1, 0.5), random.uniform(0.6, 1.2)
    return numbers, np.array([low, high, *random.uniform(-1, 1, 2)])


@eqx.filter_jit
def _ends(systems, states):
    return jax.vmap(lambda s, x: flow(s, x, 0.0, 100.0, max_steps=50_000))(
        systems, states
    )


@pytest.mark.parametrize("pulls", [((9.81, 9.81), (9.81, 9.81)), ((0.1, 1), (0.5, 2))])
def test_runs_end_at_rest_or_say_what_accumulates(pulls):
    """64 stacks, and 64 masses pushed against a wall: no other verdict."""
    made = [_random(seed, pulls) for seed in range(64)]
    names = made[0][0]
    numbers = {n: np.array([float(m[n]) for m, _ in made]) for n in names}
    ends = _ends(
        Stack(**parameters(**numbers)), jnp.asarray(np.stack([x for _, x in made]))
    )
    code, state = np.asarray(ends.code), np.asarray(ends.state)
    assert set(code) <= {FINISHED, TOGETHER}
    assert np.sum(code == TOGETHER) > 16
    # nothing but rest on the floor is left of the others
    assert np.max(np.abs(state[code == FINISHED]), initial=0.0) < 1e-9


def test_the_sentence_names_the_reason():
    numbers, state = _random(1, ((9.81, 9.81), (9.81, 9.81)))
    made = jaxcam.simulate(Stack(**parameters(**numbers)), state, 0.0, 6.0)
    assert int(made.code) == TOGETHER
    assert made.result == RESULTS[RESULTS.together]
    assert "accumulate together" in made.result


@pytest.mark.slow
def test_the_other_engine_says_the_same():
    numbers, state = _random(1, ((9.81, 9.81), (9.81, 9.81)))
    made = jaxcam.simulate(
        Stack(**parameters(**numbers)), state, 0.0, 6.0, engine="diffeqsolve"
    )
    assert int(made.code) == TOGETHER


def test_quick_impacts_on_two_walls_are_not_taken_for_it():
    """200 impacts between walls 1e-5 apart: sum of flights width / (speed r^k)."""
    r, width, speed = 0.99, 1e-5, 1.0
    ball = BallBetweenWalls(**parameters(gravity=0.0, width=width, restitution=r))
    time = width / speed * (r**-200.5 - 1) / (1 / r - 1)
    made = jaxcam.simulate(ball, np.array([0.0, speed]), 0.0, time)
    assert made.successful, made.result
    assert int(made.impacts.count) == 200


def test_a_stack_at_rest_stays():
    """Both constraints press, although the gap between the bodies feels no force."""
    stack = Stack(
        **parameters(first=9.81, second=9.81, floor=0.5, between=0.5, mass=2.0)
    )
    made = jaxcam.simulate(stack, np.zeros(4), 0.0, 3.0)
    assert made.successful, made.result
    assert int(made.impacts.count) == 0 and int(made.contacts.count) == 2
    assert np.max(np.abs(made.final)) < 1e-12
