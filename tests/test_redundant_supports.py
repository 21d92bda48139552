"""Contact forces of a beam on more supports than its equilibrium determines."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcam
from jaxcam import HybridSystem
from jaxcam.hybrid import Settings
from jaxcam.hybrid.flow_jacobian import flow_jacobian
from jaxcam.hybrid.surface import field_in_force, solve_masked
from jaxcam.hybrid.surface._contact_forces import contact_forces
from jaxcam.hybrid.surface._masked import null_vector


INERTIA = 0.3


class Beam(HybridSystem):
    """A rigid beam of unit mass: height, angle, and their rates; unit gravity. A torque
    that grows with time turns it anticlockwise.
    """

    feet: tuple = (-1.0, 0.0, 1.0)
    torque: float = 0.0
    ramp: float = 0.0
    restitution: float = 0.3

    def vector_field(self, t, state):
        torque = self.torque + self.ramp * t
        return jnp.stack([state[2], state[3], -1.0, torque / INERTIA])

    def gap(self, t, state):
        height, angle = state[:2]
        return jnp.stack([height + a * jnp.sin(angle) for a in self.feet])

    def impact(self, t, state):
        rows = []
        for a in self.feet:
            arm = a * jnp.cos(state[1])
            push = -(1 + self.restitution) * (state[2] + arm * state[3])
            push = push / (1 + arm**2 / INERTIA)
            rows.append(state + push * jnp.stack([0.0, 0.0, 1.0, arm / INERTIA]))
        return jnp.stack(rows)


def _forces(beam, feet, contact):
    q = contact_forces(beam, 0.0, jnp.zeros(4), jnp.array(contact)).multipliers
    return -np.asarray(q) / (1 + np.square(feet) / INERTIA)


@pytest.mark.parametrize(
    "feet", [(-1.0, 0.0, 1.0), (-1.0, 0.5, 1.0), (-1.0, 0.2, 1.0, 1.2)]
)
@pytest.mark.parametrize("torque", [0.0, 0.2])
def test_forces_are_in_equilibrium(feet, torque):
    """Sum 1, moment -torque, to 1e-14; each force is that of a spring in proportion to
    the effective mass at its foot, under a rigid body.
    """
    forces = _forces(Beam(feet, torque), feet, [True] * len(feet))
    a = np.array(feet)
    assert abs(np.sum(forces) - 1) < 1e-14
    assert abs(forces @ a + torque) < 1e-14
    sinking = forces * (1 + a**2 / INERTIA)
    line = np.polyfit(a, sinking, 1)
    np.testing.assert_allclose(sinking, np.polyval(line, a), atol=1e-13)
    field = field_in_force(
        Beam(feet, torque), 0.0, jnp.zeros(4), jnp.ones(len(a), bool)
    )
    np.testing.assert_allclose(field, 0.0, atol=1e-14)


def test_forces_of_two_supports_are_those_of_statics():
    """A support that is not in contact carries nothing; to 1e-15."""
    forces = _forces(Beam(), (-1.0, 0.0, 1.0), [False, True, True])
    np.testing.assert_allclose(forces, [0, 1, 0], atol=1e-15)


@pytest.mark.parametrize("seed", range(5))
def test_solutions_in_the_range_of_the_matrix(seed):
    """Of a random matrix of rank 2 with 4 rows, some of them masked: the system is
    solved, and the solution is in the range of the matrix, both to 1e-10.
    """
    rng = np.random.default_rng(seed)
    arms = rng.standard_normal((4, 2))
    square = arms @ arms.T
    matrix = square / np.diag(square)
    mask = rng.permutation([True, True, True, seed % 2 == 0])
    right = matrix @ (mask * rng.standard_normal(4))
    found = np.asarray(
        solve_masked(jnp.array(matrix), jnp.array(right), jnp.array(mask))
    )
    part = matrix[np.ix_(mask, mask)]
    np.testing.assert_allclose(part @ found[mask], right[mask], atol=1e-10)
    assert np.all(found[~mask] == 0)
    within = np.linalg.lstsq(part, found[mask], rcond=None)[0]
    np.testing.assert_allclose(part @ within, found[mask], atol=1e-10)


@pytest.mark.parametrize("seed", range(8))
def test_solutions_with_different_friction(seed):
    """Of matrices of rank 3 with 4 rows that are not symmetric, as with friction, of
    which three rows have rank 2, in any order: the system is solved, and the null
    vector is one, to 1e-10.
    """
    rng = np.random.default_rng(seed)
    order = rng.permutation(4)
    gradients = np.array([[0, 1, -1.0], [0, 1, 0.3], [0, 1, 1], [1, 0, 0.4]])[order]
    pushes = (gradients + 0.4 * rng.standard_normal((4, 3))) / 2
    matrix, mask = gradients @ pushes.T, np.ones(4, dtype=bool)
    right = matrix @ rng.standard_normal(4)
    given = jnp.array(matrix), jnp.array(right), jnp.array(mask)
    found = np.asarray(solve_masked(*given))
    np.testing.assert_allclose(matrix @ found, right, atol=1e-10)
    null, number = map(np.asarray, null_vector(given[0], given[2]))
    assert number == 1
    assert np.max(np.abs(null)) >= 1
    np.testing.assert_allclose(matrix @ null, 0.0, atol=1e-10)


def test_a_beam_falls_to_rest_on_three_feet():
    """At height and angle 0, to 1e-12; each foot is in contact until the end."""
    run = jaxcam.simulate(Beam(), [0.3, 0.02, 0.0, 0.0], 0.0, 4.0)
    assert run.successful, run.result
    np.testing.assert_allclose(run.final, 0.0, atol=1e-12)
    held = np.asarray(run.contacts.constraint)[~np.asarray(run.contacts.released)]
    assert sorted(held) == [0, 1, 2]


def test_a_beam_turns_about_its_last_foot():
    """A torque of -1.2 t exceeds the weight times the arm of the last foot at t = 1 /
    1.2. All other feet leave at this time, to 1e-12, although the middle foot could
    carry a load without the first one; then the beam turns as on two feet, to 1e-9.
    """
    runs = [
        jaxcam.simulate(Beam(feet, ramp=-1.2), [0.0, 0.0, 0.0, 0.0], 0.0, 1.2)
        for feet in [(-1.0, 1.0), (-1.0, 0.0, 1.0), (-1.0, -0.3, 0.4, 1.0)]
    ]
    for run in runs:
        assert run.successful, run.result
        ends = np.asarray(run.contacts.end)[np.asarray(run.contacts.released)]
        assert len(ends) == len(run.system.feet) - 1
        np.testing.assert_allclose(ends, 1 / 1.2, atol=1e-12)
    for run in runs[1:]:
        np.testing.assert_allclose(run.final, runs[0].final, atol=1e-9)
    assert abs(float(runs[0].final[1])) > 1e-3


@pytest.mark.parametrize(
    "feet", [(-1.0, 0.0, 1.0), (-1.0, 0.5, 1.0), (-1.0, 0.7, 0.8, 1.0)]
)
def test_a_beam_stays_while_some_forces_hold_it(feet):
    """A torque just below the limit, with forces that would be negative by the
    convention: no foot is released.
    """
    run = jaxcam.simulate(Beam(feet, ramp=-0.99), [0.0, 0.0, 0.0, 0.0], 0.0, 1.0)
    assert run.successful, run.result
    assert not np.any(run.contacts.released)
    np.testing.assert_allclose(run.final, 0.0, atol=1e-14)


@pytest.mark.parametrize("seed", range(3))
def test_a_middle_foot_makes_no_difference(seed):
    """Ten random beams on three or four feet, with random torques from rest, move as on
    their two outer feet; to 1e-8. Most of them tip.
    """
    rng, tipped = np.random.default_rng(seed), 0
    for number in range(10):
        left, middle = -rng.uniform(0.2, 1), rng.uniform(-0.2, 0.2)
        right = rng.uniform(0.2, 1)
        torque, ramp = rng.uniform(-0.9 * right, -0.9 * left), rng.uniform(-2, 2)
        more = [rng.uniform(left, right)] * (number % 2)
        feet = tuple(rng.permutation([left, middle, *more, right]))
        ends = []
        for supports in (feet, (left, right)):
            run = jaxcam.simulate(
                Beam(supports, torque, ramp), [0.0, 0.0, 0.0, 0.0], 0.0, 1.0
            )
            assert run.successful, (supports, torque, ramp, run.result)
            ends.append(np.asarray(run.final))
        np.testing.assert_allclose(*ends, atol=1e-8)
        tipped += abs(ends[0][1]) > 1e-6
    assert 3 <= tipped <= 9


def _from(system, y):
    """Start at rest, displaced by the first four numbers, with the ramp as the last."""
    moved = eqx.tree_at(lambda b: b.ramp, system, y[4])
    return moved, y[:4], 0.0, 1.2


def test_derivatives_through_rest_on_two_feet():
    """A beam rests until it tips, at a time that does not depend on the start: no
    displacement and no velocity of the start survives, to 1e-9; and the derivative by
    the ramp is that of central differences, to 1e-6.
    """
    feet = (-1.0, 1.0)

    def final(ramp):
        start = [0.0, 0.0, 0.0, 0.0]
        return np.asarray(jaxcam.simulate(Beam(feet, ramp=ramp), start, 0.0, 1.2).final)

    y, off = np.array([0.0, 0.0, 0.0, 0.0, -1.2]), 1e-5
    arrival, matrix = flow_jacobian(_from, Beam(feet), y, Settings())
    np.testing.assert_allclose(arrival.state, final(-1.2), atol=1e-12)
    central = (final(-1.2 + off) - final(-1.2 - off)) / (2 * off)
    np.testing.assert_allclose(matrix[:, 4], central, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(matrix[:, :4], 0.0, atol=1e-9)
