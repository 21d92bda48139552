"""Impacts on several constraints at the same instant."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from textbook_systems import parameters

import jaxcam
from jaxcam import HybridSystem
from jaxcam.hybrid import flow
from jaxcam.hybrid.surface._complementary import complementary
from jaxcam.hybrid.surface._impacts_together import joint_impulses


def _mechanisms(number, m, seed):
    """Random inverse masses W of `m` constraints, and approaches."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(number, m, m + 1))
    inverse = rows @ rows.transpose(0, 2, 1)
    return inverse, rng.normal(size=(number, m)) - 0.3, rng.random((number, m))


def _scaled(inverse):
    """Changes of the velocities by impulses that change their own by one."""
    return inverse / np.diagonal(inverse, axis1=1, axis2=2)[:, None, :]


def _by_enumeration(inverse, before):
    """The impulses of the complementarity problem, by trying all active sets."""
    m = len(before)
    for bits in itertools.product((False, True), repeat=m):
        on, p = np.array(bits), np.zeros(m)
        if on.any():
            p[on] = np.linalg.solve(inverse[np.ix_(on, on)], -before[on])
        after = before + inverse @ p
        if np.all(p >= -1e-12) and np.all(after[~on] >= -1e-12):
            return p
    raise AssertionError("no solution")


@pytest.mark.parametrize("m", [1, 2, 3, 4])
def test_the_complementarity_problem_against_numpy(m):
    """To 1e-12 of the largest impulse, with random mass matrices."""
    inverse, before, _ = _mechanisms(60, m, m)
    matrix, closed = _scaled(inverse), jnp.ones(m, bool)
    found = jax.vmap(lambda g, v: complementary(g, v, closed))(matrix, before)
    for k in range(len(before)):
        expected = _by_enumeration(inverse[k], before[k]) * np.diag(inverse[k])
        size = 1 + np.max(np.abs(expected)) * np.linalg.cond(matrix[k])
        np.testing.assert_allclose(found[k], expected, atol=1e-14 * size)


def test_an_open_gap_has_no_impulse():
    inverse, before, _ = _mechanisms(20, 3, 5)
    closed = jnp.array([True, False, True])
    for w, v in zip(inverse, before, strict=True):
        matrix = _scaled(w[None])[0]
        found = np.asarray(complementary(jnp.asarray(matrix), jnp.asarray(v), closed))
        part = np.ix_([0, 2], [0, 2])
        expected = _by_enumeration(w[part], v[[0, 2]]) * np.diag(w)[[0, 2]]
        assert found[1] == 0
        np.testing.assert_allclose(found[[0, 2]], expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("m", [2, 3, 4])
def test_joint_impacts_do_not_depend_on_the_order_or_create_energy(m):
    """Any order, to 1e-11; different coefficients, energy to rounding."""
    inverse, before, restitution = _mechanisms(200, m, 10 + m)
    matrix, closed = _scaled(inverse), jnp.ones(m, bool)
    joint = jax.jit(jax.vmap(lambda g, v, e: joint_impulses(g, v, e, closed)))
    found = np.asarray(joint(matrix, before, restitution))
    order = np.random.default_rng(1).permutation(m)
    swapped = matrix[:, order][:, :, order]
    again = np.asarray(joint(swapped, before[:, order], restitution[:, order]))
    size = 1 + np.abs(found).max(axis=1) * np.linalg.cond(matrix)
    assert np.max(np.abs(again - found[:, order]) / size[:, None]) < 1e-14
    after = before + np.einsum("kij,kj->ki", matrix, found)
    assert np.min(after) > -1e-9
    # twice the change of the energy
    impulse = found / np.diagonal(inverse, axis1=1, axis2=2)
    gained = np.sum(impulse * (before + after), axis=1)
    assert np.max(gained) < 1e-9
    # equal coefficients: some impacts need no bound, and lose 1 - e^2 of the loss at 0
    equal = np.asarray(joint(matrix, before, 0.0 * restitution))
    lost = np.sum(
        equal
        / np.diagonal(inverse, axis1=1, axis2=2)
        * (2 * before + np.einsum("kij,kj->ki", matrix, equal)),
        axis=1,
    )
    half = np.asarray(joint(matrix, before, 0.0 * restitution + 0.5))
    free = np.all(np.abs(half - 1.5 * equal) < 1e-9, axis=1)
    assert np.sum(free) > 20
    change = np.sum(
        half
        / np.diagonal(inverse, axis1=1, axis2=2)
        * (2 * before + np.einsum("kij,kj->ki", matrix, half)),
        axis=1,
    )
    np.testing.assert_allclose(change[free], 0.75 * lost[free], atol=1e-9)


def test_poissons_law_alone_would_create_energy():
    """Two constraints that hinder each other, coefficients 1 and 0: it is bounded."""
    matrix, before = jnp.array([[1.0, -0.9], [-0.9, 1.0]]), jnp.array([-0.1, -0.1])
    found = joint_impulses(
        matrix, before, jnp.array([1.0, 0.0]), jnp.ones(2, dtype=bool)
    )
    after = before + matrix @ found
    # unbounded, the first would rebound at 1, ten times as fast as it came
    assert float(found @ (before + after)) < 1e-15
    assert np.all(np.asarray(after) >= -1e-15)


class Bar(HybridSystem):
    """A bar on two feet at its ends; state (height, angle, and their rates).

    `share` is its moment of inertia over that of two masses at the ends.
    """

    left: jax.Array
    right: jax.Array
    share: jax.Array
    swapped: bool = eqx.field(static=True, default=False)

    def vector_field(self, t, state):
        zero = 0.0 * state[0]
        return jnp.stack([state[2], state[3], zero - 9.81, zero])

    def _arms(self):
        arms = jnp.array([-1.0, 1.0])
        return arms[::-1] if self.swapped else arms

    def gap(self, t, state):
        return state[0] + self._arms() * state[1]

    def impact(self, t, state):
        restitution = jnp.stack([self.left, self.right])
        restitution = restitution[::-1] if self.swapped else restitution
        arms = self._arms()
        speed = state[2] + arms * state[3]
        push = -(1 + restitution) * speed / (1 + 1 / self.share)
        return jnp.stack(
            [
                state.at[2].add(p).at[3].add(a * p / self.share)
                for a, p in zip(arms, push)
            ]
        )


def _bar(left, right, share=1 / 3, swapped=False):
    given = parameters(left=left, right=right, share=share)
    return Bar(given["left"], given["right"], given["share"], swapped)


FALL = np.sqrt(2 * 0.5 / 9.81)
DROPPED = np.array([0.5, 0.0, 0.0, 0.0])


def test_a_bar_that_lands_flat_rebounds_flat():
    """With the coefficient of both feet, to 1e-12; in one impact."""
    run = jaxcam.simulate(_bar(0.6, 0.6), DROPPED, 0.0, 1.5 * FALL)
    assert run.successful, run.result
    assert int(run.impacts.count) == 1
    np.testing.assert_allclose(run.impacts.time, [FALL], atol=1e-12)
    np.testing.assert_allclose(
        run.impacts.after, [[0, 0, 0.6 * 9.81 * FALL, 0]], atol=1e-12
    )


def test_a_bar_that_lands_flat_without_restitution_stays():
    run = jaxcam.simulate(_bar(0.0, 0.0), DROPPED, 0.0, 1.0)
    assert run.successful, run.result
    assert list(run.contacts.constraint) == [0, 1]
    np.testing.assert_allclose(run.contacts.start, [FALL, FALL], atol=1e-12)
    np.testing.assert_allclose(run.final, np.zeros(4), atol=1e-14)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("pair", [(0.6, 0.4), (0.8, 0.3)])
def test_a_bar_on_different_feet_turns(pair, swapped):
    """Each foot presses with v / (1 + g), and pushes back with e times that.

    In the second case, the right foot would still approach, and stays instead.
    """
    run = jaxcam.simulate(_bar(*pair, swapped=swapped), DROPPED, 0.0, 1.1 * FALL)
    assert run.successful, run.result
    g = (1 - 3) / (1 + 3)
    mutual = np.array([[1, g], [g, 1]])
    feet = mutual @ np.array(pair) * 9.81 * FALL / (1 + g)
    if feet[1] < 0:
        feet = feet - feet[1] * mutual[1]
    expected = [0, 0, np.mean(feet), (feet[1] - feet[0]) / 2]
    np.testing.assert_allclose(run.impacts.after[0], expected, atol=1e-12)


@pytest.mark.parametrize("pair", [(0.6, 0.6), (0.3, 0.3), (0.8, 0.3), (0.9, 0.0)])
def test_a_bar_comes_to_rest_on_both_feet(pair):
    """With equal coefficients, after the time T (1 + e) / (1 - e), to 1e-6."""
    run = jaxcam.simulate(_bar(*pair), DROPPED, 0.0, 8 * FALL)
    assert run.successful, run.result
    np.testing.assert_allclose(run.final, np.zeros(4), atol=1e-15)
    assert sorted(np.asarray(run.contacts.constraint)[-2:]) == [0, 1]
    e = pair[0]
    if pair == (e, e):
        times = run.contacts.start
        np.testing.assert_allclose(times, [FALL * (1 + e) / (1 - e)] * 2, atol=1e-6)
    states = np.asarray(run.steps.state)
    energy = 9.81 * states[:, 0] + states[:, 2:] ** 2 @ np.array([1 / 2, 1 / 6])
    assert np.max(energy) < 9.81 * 0.5 * (1 + 1e-12)


def test_a_bar_that_lands_nearly_flat_has_two_impacts():
    """One foot after the other, at gaps far above rounding."""
    start = np.array([0.5, 1e-6, 0.0, 0.0])
    run = jaxcam.simulate(_bar(0.6, 0.6), start, 0.0, 1.2 * FALL)
    assert run.successful, run.result
    assert sorted(np.asarray(run.impacts.constraint)[:2]) == [0, 1]


@pytest.mark.slow
def test_both_engines_land_flat_alike():
    first, second = (
        jaxcam.simulate(_bar(0.6, 0.6), DROPPED, 0.0, 3.2 * FALL, engine=engine).final
        for engine in ("loop", "diffeqsolve")
    )
    np.testing.assert_allclose(first, second, atol=1e-9)


def test_the_derivative_of_a_flat_landing():
    """By height and coefficient: closed form, to 1e-9."""

    @jax.jit
    @jax.jacfwd
    def slope(values):
        height, restitution = values
        bar = Bar(restitution, restitution, jnp.asarray(1 / 3))
        start = jnp.stack([height, *jnp.zeros(3)])
        return flow(bar, start, 0.0, 1.5 * FALL).state

    height, e, g, t = 0.5, 0.6, 9.81, 1.5 * FALL
    # y = e g T (t - T) - g (t - T)^2 / 2 with the fall T
    rate = 1 / np.sqrt(2 * g * height)
    position = rate * (e * g * (t - 2 * FALL) + g * (t - FALL))
    velocity = rate * (e * g + g)
    found = np.asarray(slope(jnp.array([height, e])))
    np.testing.assert_allclose(found[:, 0], [position, 0, velocity, 0], atol=1e-9)
    by_e = [g * FALL * (t - FALL), 0, g * FALL, 0]
    np.testing.assert_allclose(found[:, 1], by_e, atol=1e-9)


class Row(HybridSystem):
    """Three equal balls on a line, one unit long each; positions and velocities."""

    restitution: jax.Array

    def vector_field(self, t, state):
        return jnp.concatenate([state[3:], jnp.zeros(3)])

    def gap(self, t, state):
        return state[1:3] - state[:2] - 1.0

    def impact(self, t, state):
        push = -(1 + self.restitution) * (state[4:] - state[3:5]) / 2
        return jnp.stack(
            [
                state.at[3].add(-push[0]).at[4].add(push[0]),
                state.at[4].add(-push[1]).at[5].add(push[1]),
            ]
        )


def test_a_ball_hit_from_both_sides_stays():
    """Both others rebound with the coefficient of restitution, to 1e-14."""
    row = Row(jnp.asarray(0.5))
    run = jaxcam.simulate(row, [-1.5, 0.0, 1.5, 1.0, 0.0, -1.0], 0.0, 1.0)
    assert run.successful and int(run.impacts.count) == 1
    np.testing.assert_allclose(run.final[3:], [-0.5, 0.0, 0.5], atol=1e-14)


@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_a_ball_that_hits_a_row_at_rest(restitution):
    """Only one gap approaches at a time: Newton's cradle for a coefficient of one."""
    row = Row(jnp.asarray(restitution))
    run = jaxcam.simulate(row, [-1.5, 0.0, 1.0, 1.0, 0.0, 0.0], 0.0, 0.6)
    assert run.successful and list(run.impacts.constraint[:2]) == [0, 1]
    passed = (1 + restitution) / 2
    expected = np.array([1 - passed, passed * (1 - passed), passed**2])
    np.testing.assert_allclose(run.impacts.after[1, 3:], expected, atol=1e-14)
