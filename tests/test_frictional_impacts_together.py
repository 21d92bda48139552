"""Impacts with friction at several contacts at once."""

import itertools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.hybrid import SwitchedSystem
from jaxcam.hybrid.surface import impacts, impacts_together
from jaxcam.models import WoodpeckerToy


KINDS = "kinematic", "kinetic", "energetic", "complementarity"
CLOSED = jnp.ones(2, dtype=bool)


class Contacts(SwitchedSystem):
    """A body that touches several constraints; positions, then velocities.

    The mass matrix is `inverse` inverted; the gaps grow along the rows of `normals`,
    the contacts slip along the rows of `tangents`.
    """

    inverse: jax.Array
    normals: jax.Array
    tangents: jax.Array
    friction: jax.Array
    restitution: jax.Array
    kind: Any = "kinetic"

    @property
    def restitution_kind(self):
        return self.kind

    def switching(self, t, state):
        return self.tangents @ state[3:]

    def branch(self, t, state, sides):
        return jnp.concatenate([state[3:], jnp.zeros(3)])

    def gap(self, t, state):
        return self.normals @ state[:3]

    def impact(self, t, state):
        rows = []
        for normal, held in zip(self.normals, self.restitution, strict=True):
            moved = self.inverse @ normal
            change = -(1 + held) * (normal @ state[3:]) / (normal @ moved)
            rows.append(state.at[3:].add(change * moved))
        return jnp.stack(rows)

    def contact_friction(self, t, state, sides):
        rows = []
        for k, (normal, tangent) in enumerate(
            zip(self.normals, self.tangents, strict=True)
        ):
            scale = normal @ self.inverse @ normal
            push = -self.friction[k] * sides[k] * (self.inverse @ tangent) / scale
            rows.append(jnp.concatenate([jnp.zeros(3), push]))
        return jnp.stack(rows)


def body(parameters: Any, kind: str) -> Contacts:
    inverse, normals, tangents, friction, restitution = parameters
    return Contacts(inverse, normals, tangents, friction, restitution, kind)


def drawn(seed: int, number: int, m: int = 2):
    """Parameters and velocities of random bodies with `m` contacts, a batch of each."""
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=(number, 3, 3)) + 1.5 * np.eye(3)
    angles = rng.uniform(-1.2, 1.2, (number, m))
    normals = np.stack([np.sin(angles), np.cos(angles), rng.normal(size=(number, m))])
    tangents = np.stack([np.cos(angles), -np.sin(angles), rng.normal(size=(number, m))])
    return (
        np.einsum("kij,klj->kil", roots, roots),
        normals.transpose(1, 2, 0),
        tangents.transpose(1, 2, 0),
        rng.uniform(0.05, 0.6, (number, m)),
        rng.uniform(0, 1, (number, m)),
    ), rng.normal(size=(number, 3)) * [0.7, 1.0, 1.0] - [0, 0.8, 0]


@pytest.fixture(scope="module")
def joint():
    """The compiled joint impact, for each kind."""

    def make(kind):
        def one(parameters, velocity, closed):
            system = body(parameters, kind)
            state = jnp.concatenate([jnp.zeros(3), velocity])
            return impacts_together(system, jnp.asarray(0.0), state, closed)[3:]

        return jax.jit(jax.vmap(one, (0, 0, None)))

    return {kind: make(kind) for kind in KINDS}


def by_impulses(parameters, velocity, bounce):
    """The velocities by Newton's law and Coulomb's law, trying all states of contacts
    with numpy; physical impulses instead of those of the package.

    Each contact is open, slips with the friction `-mu p` or `+mu p`, or sticks. Of
    several solutions, the one with the smallest impulses counts.
    """
    inverse, normals, tangents, friction, _ = parameters
    best, found = np.inf, None
    for states in itertools.product("o+-s", repeat=2):
        rows, columns, aims = [], [], []
        for k, state in enumerate(states):
            if state == "o":
                continue
            rows.append(normals[k])
            aims.append(-bounce[k])
            if state == "s":
                columns += [normals[k], tangents[k]]
                rows.append(tangents[k])
                aims.append(0.0)
            else:
                push = -friction[k] if state == "+" else friction[k]
                columns.append(normals[k] + push * tangents[k])
        after, sizes = velocity, np.zeros(0)
        if rows:
            matrix = np.array(rows) @ inverse @ np.array(columns).T
            if np.linalg.cond(matrix) > 1e12:
                continue
            sizes = np.linalg.solve(matrix, np.array(aims) - np.array(rows) @ velocity)
            after = velocity + inverse @ np.array(columns).T @ sizes
        margins, place, total = [], 0, 0.0
        for k, state in enumerate(states):
            if state == "o":
                margins.append(normals[k] @ after + bounce[k])
                continue
            margins.append(sizes[place])
            total += sizes[place] * (normals[k] @ inverse @ normals[k])
            slip = tangents[k] @ after
            if state == "s":
                margins.append(friction[k] * sizes[place] - abs(sizes[place + 1]))
                place += 1
            else:
                margins.append(slip if state == "+" else -slip)
            place += 1
        if min(margins) > -1e-10 and total < best:
            best, found = total, after
    assert found is not None
    return found


def test_joint_impacts_against_enumeration(joint):
    """Inelastic impacts of 120 random bodies, to 1e-9; all states of contact occur."""
    parameters, velocity = drawn(1, 120)
    inelastic = (*parameters[:4], 0 * parameters[4])
    found = np.asarray(joint["complementarity"](inelastic, velocity, CLOSED))
    for k in range(120):
        one = [p[k] for p in inelastic]
        expected = by_impulses(one, velocity[k], np.zeros(2))
        np.testing.assert_allclose(found[k], expected, atol=1e-9)
    # without restitution, the laws agree
    for kind in KINDS[:3]:
        again = np.asarray(joint[kind](inelastic, velocity, CLOSED))
        np.testing.assert_allclose(again, found, atol=1e-9)
    slips = np.abs(np.einsum("kij,kj->ki", parameters[2], found)) > 1e-9
    moves = np.einsum("kij,kj->ki", parameters[1], found) > 1e-9
    states = {tuple(zip(*pair, strict=True)) for pair in zip(slips, moves, strict=True)}
    assert len(states) > 6


def test_newtons_coefficient_at_joint_impacts(joint):
    """With restitution, to 1e-9, where the law does not create energy."""
    parameters, velocity = drawn(2, 100)
    found = np.asarray(joint["complementarity"](parameters, velocity, CLOSED))
    compared = 0
    for k in range(100):
        one = [p[k] for p in parameters]
        bounce = one[4] * np.minimum(one[1] @ velocity[k], 0)
        expected = by_impulses(one, velocity[k], bounce)
        mass = np.linalg.inv(one[0])
        gained = expected @ mass @ expected - velocity[k] @ mass @ velocity[k]
        if gained < -1e-9:
            compared += 1
            np.testing.assert_allclose(found[k], expected, atol=1e-9)
    assert compared > 75


@pytest.mark.parametrize("kind", KINDS)
def test_no_energy_is_created_and_no_gap_closes(joint, kind):
    """1000 random bodies with different coefficients of restitution, to 1e-9."""
    parameters, velocity = drawn(3, 1000)
    found = np.asarray(joint[kind](parameters, velocity, CLOSED))
    mass = np.linalg.inv(parameters[0])
    before, after = (np.einsum("ki,kij,kj->k", v, mass, v) for v in (velocity, found))
    assert np.max((after - before) / before) < 1e-9
    assert np.min(np.einsum("kij,kj->ki", parameters[1], found)) > -1e-9
    # some of them do rebound
    assert np.mean(after > 0.3 * before) > 0.1


@pytest.mark.parametrize("kind", KINDS)
def test_the_order_of_the_constraints_does_not_matter(joint, kind):
    """300 random bodies with their constraints exchanged, to 1e-9."""
    parameters, velocity = drawn(4, 300)
    exchanged = (parameters[0], *(p[:, ::-1] for p in parameters[1:]))
    first, second = (
        np.asarray(joint[kind](p, velocity, CLOSED)) for p in (parameters, exchanged)
    )
    np.testing.assert_allclose(first, second, atol=1e-9)


@pytest.mark.parametrize("kind", ["kinetic", "complementarity"])
def test_three_contacts(kind):
    """Energy and normal velocities of 300 bodies, to 1e-8; the third is without
    friction in half of them.
    """
    parameters, velocity = drawn(7, 300, 3)
    parameters[3][::2, 2] = 0.0

    @jax.jit
    @jax.vmap
    def joint(one, v):
        state = jnp.concatenate([jnp.zeros(3), v])
        closed = jnp.ones(3, dtype=bool)
        return impacts_together(body(one, kind), jnp.asarray(0.0), state, closed)[3:]

    found = np.asarray(joint(parameters, velocity))
    mass = np.linalg.inv(parameters[0])
    before, after = (np.einsum("ki,kij,kj->k", v, mass, v) for v in (velocity, found))
    assert np.max((after - before) / before) < 1e-8
    assert np.min(np.einsum("kij,kj->ki", parameters[1], found)) > -1e-8
    assert np.mean(after > 0.1 * before) > 0.1


@pytest.mark.parametrize("kind", ["kinetic", "complementarity"])
def test_a_contact_at_rest(joint, kind):
    """A rounding error of its normal velocity has no effect, to 1e-8."""
    parameters, velocity = drawn(8, 200)
    normal, other = parameters[1][:, 1], parameters[1][:, 0]
    size = np.sum(normal * normal, axis=1)
    results = []
    for rest in (-1e-16, 0.0, 1e-12):
        along = (rest - np.sum(normal * velocity, axis=1)) / size
        at_rest = velocity + along[:, None] * normal
        results.append(np.asarray(joint[kind](parameters, at_rest, CLOSED)))
    assert np.sum(np.sum(other * at_rest, axis=1) < 0) > 50
    assert np.all(np.isfinite(results))
    # a body may be at the point of slipping
    same = np.max(np.abs(np.subtract(results[:2], results[2])), axis=(0, 2)) < 1e-8
    assert np.sum(same) >= 198


@pytest.mark.parametrize("friction", [0.0, 1e-10, 1e-7])
def test_weak_friction(joint, friction):
    """No gap closes further, to 1e-9, and the motion tends to that without."""
    parameters, velocity = drawn(9, 200)
    results = []
    for value in (friction, 0.0):
        one = (*parameters[:3], np.full((200, 2), value), 0 * parameters[4])
        results.append(np.asarray(joint["kinetic"](one, velocity, CLOSED)))
    assert np.min(np.einsum("kij,kj->ki", parameters[1], results[0])) > -1e-9
    assert np.max(np.abs(results[0] - results[1])) < 1e3 * friction + 1e-9


def test_no_closed_contact(joint):
    """Nothing changes: the derivative in reverse mode is the identity."""
    parameters, velocity = drawn(10, 20)
    none = jnp.zeros(2, dtype=bool)
    found = joint["kinetic"](parameters, velocity, none)
    np.testing.assert_array_equal(found, velocity)
    slopes = jax.vmap(jax.jacrev(joint["kinetic"].__wrapped__, 1), (0, 0, None))
    one = (jax.tree.map(lambda p: p[:, None], parameters), velocity[:, None], none)
    whole = np.asarray(jax.jit(slopes)(*one))[:, 0, :, 0]
    np.testing.assert_array_equal(whole, np.broadcast_to(np.eye(3), whole.shape))


def test_one_closed_contact_alone(joint):
    """The joint law agrees with that of one contact, to 1e-9; the other gap is open."""
    parameters, velocity = drawn(5, 300)
    speed = np.einsum("ki,ki->k", parameters[1][:, 0], velocity)
    velocity = velocity[speed < 0]
    parameters = tuple(p[speed < 0] for p in parameters)
    closed = jnp.array([True, False])
    found = joint["complementarity"](parameters, velocity, closed)

    @jax.vmap
    def alone(one, v):
        system = body(one, "complementarity")
        state = jnp.concatenate([jnp.zeros(3), v])
        return impacts(system, jnp.asarray(0.0), state)[0, 3:]

    expected = np.asarray(alone(parameters, velocity))
    mass = np.linalg.inv(parameters[0])
    energy = [np.einsum("ki,kij,kj->k", v, mass, v) for v in (velocity, expected)]
    kept = energy[1] < energy[0] - 1e-9
    assert np.mean(kept) > 0.8
    np.testing.assert_allclose(found[kept], expected[kept], atol=1e-9)


def test_the_derivatives_of_a_joint_impact():
    """Forward and reverse, against central differences, to 1e-6."""
    parameters, velocity = jax.tree.map(jnp.asarray, drawn(6, 40))

    def after(values, k, v):
        scaled = [p[k] for p in parameters]
        scaled[3], scaled[4] = scaled[3] * values[0], scaled[4] * values[1]
        system = body(scaled, "kinetic")
        state = jnp.concatenate([jnp.zeros(3), v * values[2:]])
        return impacts_together(system, jnp.asarray(0.0), state, CLOSED)[3:]

    values, step, places = jnp.ones(5), 1e-6, jnp.arange(40)
    slopes = jax.jit(jax.vmap(jax.jacfwd(after), (None, 0, 0)))
    forward = np.asarray(slopes(values, places, velocity))
    slopes = jax.jit(jax.vmap(jax.jacrev(after), (None, 0, 0)))
    reverse = np.asarray(slopes(values, places, velocity))
    assert np.all(np.isfinite(forward))
    size = 1 + np.max(np.abs(forward), axis=(1, 2))
    assert np.max(np.abs(reverse - forward), axis=(1, 2)).max() < 1e-9 * size.max()
    value = jax.jit(jax.vmap(jax.vmap(after, (0, None, None)), (None, 0, 0)))
    moves = jnp.concatenate([jnp.eye(5), -jnp.eye(5)])
    ends = np.asarray(value(values[None] + step * moves, places, velocity))
    expected = ((ends[:, :5] - ends[:, 5:]) / (2 * step)).transpose(0, 2, 1)
    off = np.max(np.abs(forward - expected), axis=(1, 2)) / size
    # a contact may be at the point of slipping
    assert np.sum(off < 1e-6) >= 38


def test_the_compliance_of_the_woodpecker_toy():
    """It is the inverse of the mass matrix, to 1e-9; at a joint impact, the beak
    rebounds and the edge stays outside the bar.
    """
    toy = WoodpeckerToy()
    bird, sleeve = 4.5e-3, 3e-4
    mass = [
        [bird + sleeve, bird * 0.01, bird * 0.015],
        [bird * 0.01, 5e-9 + bird * 0.01**2, bird * 0.01 * 0.015],
        [bird * 0.015, bird * 0.01 * 0.015, 7e-7 + bird * 0.015**2],
    ]
    np.testing.assert_allclose(toy._inverse @ np.array(mass), np.eye(3), atol=1e-9)
    # the beak hits while the upper edge jams
    state = jnp.array([0.0, 0.6 / 5.8, 0.12, -0.1, 0.0, 17.0])
    closed = jnp.array([True, False, True])
    after = np.asarray(impacts_together(toy, jnp.asarray(0.0), state, closed))
    gaps = np.asarray(toy._normals) @ after[3:]
    np.testing.assert_allclose(gaps[0], 0.5 * 0.02 * 17.0, atol=1e-9)
    assert gaps[2] > -1e-12
    twice = [v @ np.array(mass) @ v for v in (np.asarray(state[3:]), after[3:])]
    assert twice[1] < twice[0]
