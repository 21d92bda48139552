"""Bodies that come to rest together: impacts on two constraints accumulate."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mpmath import mp
from textbook_systems import BallBetweenWalls, parameters

import jaxcam
from jaxcam import HybridSystem
from jaxcam.hybrid import flow
from jaxcam.hybrid.codes import FINISHED


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


def _fall(a, b, c, leaves):
    """The smallest positive time at which c + b t + a t^2 / 2 is zero."""
    if leaves:
        return -2 * b / a if a < 0 < b else (mp.inf if b >= 0 <= a else mp.mpf(0))
    if b <= 0 >= c:
        return mp.mpf(0)
    if a == 0:
        return -c / b if b < 0 else mp.inf
    inside = b * b - 2 * a * c
    if inside < 0:
        return mp.inf
    roots = [(-b + sign * mp.sqrt(inside)) / a for sign in (-1, 1)]
    return min([root for root in roots if root > 0], default=mp.inf)


def _accumulation(numbers, state) -> float:
    """When a `Stack` comes to rest, by impact after impact with 50 digits.

    A contact begins where the impacts on one constraint become slower than 1e-20.
    """
    with mp.workdps(50):
        g1, g2, r1, r2, mass = (mp.mpf(float(v)) for v in numbers.values())
        x1, x2, v1, v2 = (mp.mpf(float(v)) for v in state)
        time, held, last, tiny = mp.mpf(0), [False, False], None, mp.mpf(10) ** -20
        while True:
            a1, a2 = (mp.mpf(0) if held[0] else -g1), -g2
            if held[1]:
                a1 = a2 = -(g1 + mass * g2) / (1 + mass)
            falls = [
                _fall(a1, v1, x1, last == 0),
                _fall(a2 - a1, v2 - v1, x2 - x1, last == 1),
            ]
            falls = [mp.inf if h else one for h, one in zip(held, falls, strict=True)]
            dt = min(falls)
            time, last = time + dt, falls.index(dt)
            x1, x2 = x1 + v1 * dt + a1 * dt**2 / 2, x2 + v2 * dt + a2 * dt**2 / 2
            v1, v2 = v1 + a1 * dt, v2 + a2 * dt
            if last == 0:
                x1, v1, x2 = mp.mpf(0), -r1 * v1, (mp.mpf(0) if held[1] else x2)
                slow = v1 < tiny
            else:
                push = -(1 + r2) * (v2 - v1) / (1 + 1 / mass)
                x2, v1, v2 = x1, v1 - push, v2 + push / mass
                slow = v2 - v1 < tiny
            held[1 - last] = False
            if slow and max(abs(v1), abs(v2)) < 1e6 * tiny and x2 < tiny:
                return float(time)
            if slow and last == 0:
                held[0], v1 = True, mp.mpf(0)
            elif slow and g2 > g1:
                held[1], v1 = True, (v1 + mass * v2) / (1 + mass)
                v2 = v1


@eqx.filter_jit
def _ends(systems, states):
    return jax.vmap(lambda s, x: flow(s, x, 0.0, 100.0, max_steps=50_000))(
        systems, states
    )


@pytest.mark.parametrize("pulls", [((9.81, 9.81), (9.81, 9.81)), ((0.1, 1), (0.5, 2))])
def test_bodies_come_to_rest_together(pulls):
    """64 stacks, and 64 pairs of masses pushed against a wall: at rest to 1e-12."""
    made = [_random(seed, pulls) for seed in range(64)]
    names = made[0][0]
    numbers = {n: np.array([float(m[n]) for m, _ in made]) for n in names}
    ends = _ends(
        Stack(**parameters(**numbers)), jnp.asarray(np.stack([x for _, x in made]))
    )
    assert set(np.asarray(ends.code)) == {FINISHED}
    assert np.max(np.abs(np.asarray(ends.state))) < 1e-12


def _start(made) -> float:
    """The time from which both constraints are in contact."""
    assert made.successful, made.result
    last = np.asarray(made.contacts.constraint)[-2:], made.contacts.start[-2:]
    assert sorted(last[0]) == [0, 1] and last[1][0] == last[1][1]
    return float(last[1][0])


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_they_rest_from_the_accumulation_on(seed):
    """Against impacts followed with 50 digits: to 3e-6 s."""
    numbers, state = _random(seed, ((0.1, 1), (0.5, 2)))
    made = jaxcam.simulate(Stack(**parameters(**numbers)), state, 0.0, 100.0)
    assert _start(made) == pytest.approx(_accumulation(numbers, state), abs=3e-6)


def test_the_time_of_rest_has_the_derivative_of_its_scaling_law():
    """From rest, it is proportional to g^(-1/2): to 1e-9 through 60 impacts."""
    numbers, state = _random(1, ((9.81, 9.81), (9.81, 9.81)))
    start = jnp.asarray([state[0], state[1], 0.0, 0.0])

    def rest(gravity):
        given = parameters(**{**numbers, "first": 1.0, "second": 1.0})
        stack = Stack(**{**given, "first": gravity, "second": gravity})
        made = jaxcam.simulate(stack, start, 0.0, 2.0, max_steps=3000)
        return made.contacts.start[made.contacts.count - 1]

    gravity = jnp.asarray(9.81)
    time, slope = jax.jvp(rest, (gravity,), (jnp.ones(()),))
    assert float(slope) == pytest.approx(-float(time) / (2 * 9.81), rel=1e-9)


@pytest.mark.slow
def test_the_other_engine_has_the_same_rest():
    numbers, state = _random(1, ((9.81, 9.81), (9.81, 9.81)))
    stack = Stack(**parameters(**numbers))
    one = jaxcam.simulate(stack, state, 0.0, 1.0)
    other = jaxcam.simulate(stack, state, 0.0, 1.0, engine="diffeqsolve")
    assert _start(one) == pytest.approx(_start(other), abs=1e-6)


@pytest.mark.parametrize("restitution", [0.05, 0.2])
def test_a_body_trapped_without_a_force_comes_to_rest(restitution):
    """Inelastic collapse: infinitely many impacts in a finite time."""
    stack = Stack(
        **parameters(
            first=0.0, second=0.0, floor=restitution, between=restitution, mass=2.0
        )
    )
    made = jaxcam.simulate(stack, np.array([0.5, 1.0, 0.0, -1.0]), 0.0, 2.0)
    assert made.successful, made.result
    assert np.max(np.abs(made.final)) < 1e-12


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
