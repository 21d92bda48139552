"""Contacts whose multiplier is zero on an interval, or has a multiple zero.

A body of unit mass rests on a surface under a force a(t) along the normal, known in
closed form: contact holds while a <= 0, and from the release on the gap is the second
integral of a.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given, settings, strategies

import jaxcam
from jaxcam import HybridSystem


_END, _ROOTS = 2.0, 7


class Pulled(HybridSystem):
    """Unit mass over a plane under a force with these zeros; state (height, speed)."""

    sign: jax.Array
    zeros: jax.Array
    used: jax.Array

    def force(self, t):
        factors = jnp.where(self.used > 0, t - self.zeros, 1.0)
        force = self.sign
        for k in range(_ROOTS):
            force = force * factors[k]
        return force

    def vector_field(self, t, state):
        return jnp.stack([state[1], self.force(t)])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return state.at[1].multiply(-0.5)


class PulledByPhase(Pulled):
    """The same with time as a third state: contact is integrated, not algebraic."""

    def vector_field(self, t, state):
        return jnp.stack([state[1], self.force(state[2]), jnp.ones_like(t)])


class Pressed(HybridSystem):
    """Unit mass over a plane: no force until `begin`, sign (t - begin)^power then."""

    sign: jax.Array
    begin: jax.Array
    restitution: jax.Array
    power: int = eqx.field(static=True)

    def vector_field(self, t, state):
        late = jnp.maximum(t - self.begin, 0.0)
        return jnp.stack([state[1], self.sign * late**self.power])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return state.at[1].multiply(-self.restitution)


def _pulled(kind, sign, zeros):
    numbers, used = np.zeros(_ROOTS), np.zeros(_ROOTS)
    numbers[: len(zeros)], used[: len(zeros)] = zeros, 1.0
    return kind(jnp.asarray(float(sign)), jnp.asarray(numbers), jnp.asarray(used))


def _truth(sign, zeros):
    """Time of release, of the return to the surface, and the gap in between."""
    force = float(sign) * np.polynomial.Polynomial.fromroots(zeros)
    edges = np.unique([0.0, *[z for z in zeros if 0 < z < _END], _END])
    pulls = force((edges[:-1] + edges[1:]) / 2) > 0
    if not np.any(pulls):
        return np.inf, np.inf, None
    release = edges[np.argmax(pulls)]
    speed = force.integ(lbnd=release)
    gap = speed.integ(lbnd=release)
    grid = np.linspace(release, _END, 4001)[1:]
    (under,) = np.nonzero(gap(grid) < -1e-12)
    back = grid[under[0] - 1] if len(under) else _END
    return release, back, gap


def _check(trajectory, sign, zeros):
    release, back, gap = _truth(sign, zeros)
    assert trajectory.successful, trajectory.result
    times = np.linspace(0.0, _END, 41)
    found = np.asarray(trajectory.at(times))[:, 0]
    assert np.min(found) > -1e-11
    held = times <= release
    assert np.max(np.abs(found[held])) < 1e-12
    if gap is None:
        assert int(trajectory.impacts.count) == 0
        return
    # a release that is late by so little that the gap does not show it is the same one
    end = np.asarray(trajectory.contacts.end)[:1]
    late = end[0] if len(end) and release > 0 else release
    assert abs(gap(late)) < 1e-12
    flown = (times > release) & (times < back)
    np.testing.assert_allclose(found[flown], gap(times[flown]), rtol=1e-9, atol=1e-11)


def _start(kind):
    return np.zeros(3 if kind is PulledByPhase else 2)


_signs = strategies.sampled_from([-1, 1])
_places = strategies.sampled_from([0.0, 0.25, 0.7, 1.0, 1.3])
_zeros = strategies.lists(
    strategies.tuples(_places, strategies.integers(1, 4)), min_size=1, max_size=2
).map(lambda pairs: sorted(z for z, k in pairs for _ in range(k))[:_ROOTS])


@pytest.mark.parametrize("kind", [Pulled, PulledByPhase])
@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("place", [0.0, 1.0])
def test_multiple_zero(kind, sign, place):
    """a = +-(t - t0)^k, k = 1..7: release, gap to 1e-11, and rest where none is due."""
    for power in range(1, _ROOTS + 1):
        zeros = [place] * power
        system = _pulled(kind, sign, zeros)
        trajectory = jaxcam.simulate(system, _start(kind), 0.0, _END)
        _check(trajectory, sign, zeros)


@pytest.mark.parametrize("kind", [Pulled, PulledByPhase])
@settings(max_examples=60)
@given(_signs, _zeros)
@example(1, [0.0] * 5)
@example(-1, [0.0])
@example(1, [1.0] * 5)
def test_products_of_zeros(kind, sign, zeros):
    """Any product of powers, the same."""
    trajectory = jaxcam.simulate(_pulled(kind, sign, zeros), _start(kind), 0.0, _END)
    _check(trajectory, sign, zeros)


def test_release_at_a_triple_zero_after_a_double_one():
    """A force of t^2 (t - 1/4)^3, from rest without a force."""
    zeros = [0.0, 0.0, 0.25, 0.25, 0.25]
    trajectory = jaxcam.simulate(_pulled(Pulled, 1, zeros), _start(Pulled), 0.0, _END)
    _check(trajectory, 1, zeros)


@pytest.mark.slow
@settings(max_examples=8)
@given(_signs, _zeros)
def test_products_of_zeros_by_the_other_engine(sign, zeros):
    """The second engine agrees with the same closed form."""
    system = _pulled(Pulled, sign, zeros)
    trajectory = jaxcam.simulate(
        system, np.zeros(2), 0.0, _END, engine="diffeqsolve", tolerance=1e-11
    )
    release, back, gap = _truth(sign, zeros)
    assert trajectory.successful, trajectory.result
    times = np.linspace(0.0, _END, 41)
    found = np.asarray(trajectory.at(times))[:, 0]
    assert np.min(found) > -1e-10
    if gap is not None:
        flown = (times > release) & (times < back)
        np.testing.assert_allclose(
            found[flown], gap(times[flown]), rtol=1e-8, atol=1e-10
        )


@pytest.mark.parametrize("power", [3, 5])
@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_no_force_at_first(power, restitution, sign):
    """Rest without a force until t = 1: then pressed for good, or pulled off."""
    system = Pressed(
        jnp.asarray(sign), jnp.asarray(1.0), jnp.asarray(restitution), power
    )
    trajectory = jaxcam.simulate(system, np.zeros(2), 0.0, _END)
    assert trajectory.successful, trajectory.result
    assert int(trajectory.impacts.count) == 0
    times = np.linspace(0.0, _END, 21)
    late = np.maximum(times - 1.0, 0.0)
    gap = late ** (power + 2) / ((power + 1) * (power + 2)) if sign > 0 else 0 * late
    found = np.asarray(trajectory.at(times))[:, 0]
    np.testing.assert_allclose(found, gap, rtol=1e-9, atol=1e-12)
