"""Impacts with Coulomb friction in which the slip stops or reverses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import jaxcam
from jaxcam.hybrid import SwitchedSystem
from jaxcam.hybrid.surface import impacts, restitutions
from jaxcam.hybrid.surface._frictional_impact import impulses, Rates
from jaxcam.models import SpinningBall


KINDS = "kinematic", "kinetic", "energetic"
ALL_KINDS = *KINDS, "complementarity"


def drawn(rng, number: int):
    """Random contacts: inverse mass matrices, friction, velocities, restitution."""
    across = rng.uniform(0.8, 3, number)
    coupling = rng.uniform(-0.95, 0.95, number) * np.sqrt(across)
    friction = rng.uniform(0.05, 1.2, number)
    friction = np.minimum(friction, 0.9 / np.abs(coupling))
    rates = Rates(
        (coupling - friction * across, 1 - friction * coupling),
        (coupling + friction * across, 1 + friction * coupling),
    )
    side = rng.choice([-1.0, 1.0], number)
    slip = np.where(rng.random(number) < 0.2, 0.0, rng.uniform(0, 1.5, number))
    approach = -rng.uniform(0.2, 1.0, number)
    return across, coupling, friction, side, slip, approach, rng.random(number), rates


def integrated(side, slip, approach, restitution, rates, kind):
    """The same by integration over the normal impulse, phase by phase."""
    (s1, v1), (s2, v2) = rates

    def phase(s):
        if s == 0 and s1 <= 0 <= s2:
            share = s2 / (s2 - s1)
            return share, 0.0, share * v1 + (1 - share) * v2
        positive = s > 0 if s != 0 else s1 > 0
        return (1.0, s1, v1) if positive else (0.0, s2, v2)

    # slip, normal velocity, impulse during positive slip, work
    y, impulse, compressed = [side * slip, approach, 0.0, 0.0], 0.0, None
    while True:
        share, ds, dv = phase(y[0])

        def field(_, y, share=share, ds=ds, dv=dv):
            return [ds, dv, share, y[1]]

        def stops(_, y, slows=y[0] * ds < 0):
            return y[0] if slows else 1.0

        def ends(p, y):
            if compressed is None:
                return y[1]
            if kind == "kinematic":
                return y[1] + restitution * approach
            if kind == "kinetic":
                return p - (1 + restitution) * compressed[0]
            return y[3] - compressed[1] + restitution**2 * compressed[1]

        events = [stops, ends]
        for one in events:
            one.terminal = True  # pyright: ignore
        if compressed is not None and ends(impulse, y) >= -1e-12:
            return impulse, y[2], impulse - y[2]
        part = solve_ivp(
            field, (impulse, impulse + 50), y, events=events, rtol=1e-12, atol=1e-13
        )
        impulse, y = float(part.t[-1]), list(part.y[:, -1])
        if len(part.t_events[0]):
            y[0] = 0.0
        elif compressed is None:
            compressed = impulse, y[3]


@pytest.mark.parametrize("kind", KINDS)
def test_the_impulses_agree_with_integration_over_the_impulse(kind):
    """To 1e-9; with slip that goes on, stops, reverses, or is zero from the start."""
    *_, side, slip, approach, restitution, rates = drawn(np.random.default_rng(1), 40)
    found = impulses(side, slip, approach, restitution, rates, kind)
    for k in range(len(side)):
        here = tuple(tuple(float(a[k]) for a in pair) for pair in rates)
        expected = integrated(side[k], slip[k], approach[k], restitution[k], here, kind)
        np.testing.assert_allclose([part[k] for part in found], expected, atol=1e-9)


def gained(kind, number=4000):
    """The kinetic energy that random impacts add."""
    across, coupling, friction, side, slip, approach, restitution, rates = drawn(
        np.random.default_rng(2), number
    )
    found = impulses(side, slip, approach, restitution, rates, kind)
    mass = np.linalg.inv(
        np.stack(
            [np.stack([across, coupling]), np.stack([coupling, 1 + 0 * across])]
        ).transpose(2, 0, 1)
    )
    drag = friction * np.asarray(found.positive - found.negative)
    total = np.asarray(found.total)
    before = np.stack([side * slip, approach], axis=1)
    change = [coupling * total - across * drag, total - coupling * drag]
    after = before + np.stack(change, axis=1)

    def energy(u):
        return np.einsum("ki,kij,kj->k", u, mass, u) / 2

    return energy(after) - energy(before)


def test_energetic_restitution_never_adds_energy():
    """To 1e-12; with Newton's coefficient, some of the same impacts add energy."""
    assert np.max(gained("energetic")) < 1e-12
    assert np.max(gained("kinematic")) > 1e-3


class Rod(SwitchedSystem):
    """A slender rod that falls on a rough floor with its lower end.

    The state is (horizontal position, height, angle from the vertical) of the centre
    and their rates; the mass is 1 and the length 2.
    """

    friction: float = 0.4
    restitution: float = 0.6
    kind: str = "energetic"

    @property
    def restitution_kind(self):
        return self.kind

    def _rows(self, state):
        s, c = jnp.sin(state[2]), jnp.cos(state[2])
        one, zero = 1.0 + 0.0 * s, 0.0 * s
        return jnp.stack([zero, one, s]), jnp.stack([one, zero, -c])

    def switching(self, t, state):
        return self._rows(state)[1] @ state[3:]

    def branch(self, t, state, sides):
        zero = 0.0 * state[0]
        return jnp.stack([*state[3:], zero, zero - 9.81, zero])

    def gap(self, t, state):
        return state[1] - jnp.cos(state[2])

    def impact(self, t, state):
        normal, _ = self._rows(state)
        moved = normal * jnp.array([1.0, 1.0, 3.0])
        speed = normal @ state[3:]
        impulse = -(1 + self.restitution) * speed / (normal @ moved)
        return state.at[3:].add(impulse * moved)

    def contact_friction(self, t, state, sides):
        normal, tangent = self._rows(state)
        inverse = jnp.array([1.0, 1.0, 3.0])
        push = -self.friction * sides[0] / (normal * inverse @ normal)
        return jnp.zeros_like(state).at[3:].set(push * inverse * tangent)


STATE = jnp.array([0.0, np.cos(0.6), 0.6, -0.3, -1.0, 0.4])


def test_the_law_with_the_slip_after_the_impact():
    """Newton's coefficient and Coulomb's law hold after 2000 impacts, to 1e-12."""
    *_, side, slip, approach, restitution, rates = drawn(np.random.default_rng(3), 2000)
    found = impulses(side, slip, approach, restitution, rates, "complementarity")
    total, positive, negative = map(np.asarray, found)
    (s1, v1), (s2, v2) = rates
    after = side * slip + s1 * positive + s2 * negative
    rebound = approach + v1 * positive + v2 * negative
    np.testing.assert_allclose(rebound, -restitution * approach, atol=1e-12)
    np.testing.assert_allclose(total, positive + negative, atol=1e-12)
    assert np.min(positive) > -1e-12 and np.min(negative) > -1e-12
    # friction is not fully used only where the slip ends
    assert np.max(np.abs(after * np.where(after > 0, negative, positive))) < 1e-12
    holds = (positive > 1e-9) & (negative > 1e-9)
    reverses = ~holds & (after * side < -1e-9)
    assert np.sum(holds) > 200 and np.sum(reverses) > 50


def test_the_law_with_the_final_slip_in_the_range_of_painleve():
    """The body sticks where a slip forwards would pull it into the constraint."""
    rates = Rates((-3.0, -0.2), (5.0, 2.0))
    found = impulses(1.0, 1.0, -1.0, 0.5, rates, "complementarity")
    assert found.positive > 0 and found.negative > 0
    slip = 1.0 - 3.0 * found.positive + 5.0 * found.negative
    rebound = -1.0 - 0.2 * found.positive + 2.0 * found.negative
    np.testing.assert_allclose([slip, rebound], [0.0, 0.5], atol=1e-12)


def test_derivatives_without_friction_are_finite():
    """Of the law with the final slip, forward and reverse."""

    def total(v):
        side, slip = jnp.asarray(1.0), jnp.asarray(jnp.inf)
        both = (jnp.asarray(0.0), jnp.asarray(1.0))
        rates = Rates(both, both)
        return impulses(side, slip, v, 0.5, rates, "complementarity").total

    assert float(jax.grad(total)(-1.0)) == -1.5
    assert float(jax.jacfwd(total)(-1.0)) == -1.5


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_a_falling_rod(kind):
    """Velocities of the lower end after the impact, to 1e-12."""
    rod = Rod(kind=kind)
    after = impacts(rod, jnp.asarray(0.0), STATE)[0]
    normal, tangent = rod._rows(STATE)
    inverse = np.diag([1.0, 1.0, 3.0])
    scale = normal @ inverse @ normal
    across, coupling = (tangent @ inverse @ row / scale for row in (tangent, normal))
    rates = Rates(
        (coupling - 0.4 * across, 1 - 0.4 * coupling),
        (coupling + 0.4 * across, 1 + 0.4 * coupling),
    )
    slip, approach = float(tangent @ STATE[3:]), float(normal @ STATE[3:])
    found = impulses(np.sign(slip), abs(slip), approach, 0.6, rates, kind)
    forces = found.total * normal - 0.4 * (found.positive - found.negative) * tangent
    expected = STATE[3:] + inverse @ forces / scale
    np.testing.assert_allclose(after[3:], expected, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_friction_may_throw_a_rod_off_faster_than_it_came(kind):
    """The coefficient that is checked is that of the law, 0.6 to rounding, although
    friction that jams the rod raises the ratio of the normal velocities above one.
    """
    rod, state = Rod(friction=2.0, kind=kind), _jamming()
    normal, _ = rod._rows(state)
    after = impacts(rod, jnp.asarray(0.0), state)[0]
    ratio = -float(normal @ after[3:]) / float(normal @ state[3:])
    assert (ratio > 1) == (kind != "kinematic")
    found = restitutions(rod, jnp.asarray(0.0), state)
    np.testing.assert_allclose(found, [0.6], rtol=1e-12)
    assert jaxcam.simulate(rod, state, 0.0, 0.01).successful


def _jamming():
    """A rod inclined by 30 degrees that slides fast ahead of its lower end."""
    angle = np.pi / 6
    return jnp.array([0.0, np.cos(angle), angle, -3.0, -0.3, 0.0])


def test_the_derivatives_of_a_falling_rod():
    """Against central differences, to 1e-8, at an impact in which the slip reverses."""

    def after(values):
        rod = Rod(friction=values[0], restitution=values[1])
        return impacts(rod, jnp.asarray(0.0), STATE + values[2] * STATE)[0]

    at, step = jnp.array([0.05, 0.6, 0.0]), 1e-5
    slope = jax.jacfwd(after)(at)
    for k in range(3):
        move = step * jnp.eye(3)[k]
        expected = (after(at + move) - after(at - move)) / (2 * step)
        np.testing.assert_allclose(slope[:, k], expected, atol=1e-8)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_ball_that_grips_in_an_impact_comes_to_rest_rolling(restitution):
    """It rolls with 5/7 of its velocity from the first impact on, to 1e-11."""
    ball = SpinningBall(
        restitution=jnp.asarray(restitution), friction_coefficient=jnp.asarray(0.5)
    )
    run = jaxcam.simulate(ball, [0.0, 1.0, 0.5, 0.0, 0.0], 0.0, 3.0)
    assert run.successful, run.result
    assert int(run.contacts.count) == 1
    fall = np.sqrt(2 / 9.81)
    expected = 0.5 * fall + 0.5 * 5 / 7 * (3 - fall)
    np.testing.assert_allclose(run.final[2], 0.5 * 5 / 7, atol=1e-13)
    np.testing.assert_allclose(run.final[0], expected, atol=1e-11)


class Coupled(SwitchedSystem):
    """Height and position of a contact point, and their velocities; a normal force also
    accelerates the point sideways, as at the end of an inclined rod.
    """

    friction: float = 0.2
    coupling: float = 0.5
    restitution: float = 0.0

    def switching(self, t, state):
        return state[3]

    def branch(self, t, state, sides):
        return jnp.stack([state[2], state[3], -10.0, -5.0])

    def gap(self, t, state):
        return state[:1]

    def impact(self, t, state):
        push = -(1 + self.restitution) * state[2]
        return state.at[2].add(push).at[3].add(self.coupling * push)[None]

    def contact_friction(self, t, state, sides):
        push = -self.friction * sides[0]
        return jnp.stack([0.0, 0.0, self.coupling * push, push])[None]


@pytest.mark.parametrize("restitution", [0.0, 1e-9])
def test_a_slip_that_the_last_impact_reverses_goes_on_in_contact(restitution):
    """The coupling reverses the slip, although friction could hold the point at rest in
    contact. The slip then decreases until the point sticks.

    Of a velocity of 1 m/s, a restitution of 1e-9 changes times by 1e-9 s; it only makes
    sure that contact does not begin exactly at the impact.
    """
    system = Coupled(restitution=restitution)
    run = jaxcam.simulate(system, [0.0095, 0.0, -0.9, -0.05], 0.0, 0.4)
    assert run.successful, run.result
    assert run.impacts.count == 1 and run.contacts.start.shape == (1,)
    # impulses until the slip of -0.1 has stopped, and afterwards; the deceleration
    first = 0.1 / (0.5 + 0.2)
    slip = (0.5 - 0.2) * (1 - (1 + 0.2 * 0.5) * first) / (1 - 0.2 * 0.5)
    slows = 5 - 10 * (0.5 - 0.2) / (1 - 0.2 * 0.5)
    stop = 0.01 + slip / slows
    switches = run.switches
    assert switches is not None
    np.testing.assert_allclose(switches.time, [0.01, stop], rtol=0, atol=1e-8)
    np.testing.assert_allclose(switches.after[0][3], slip, rtol=1e-8)
    at_rest = np.asarray(run.at(jnp.array([0.39])))[0]
    end = -0.00075 + slip**2 / (2 * slows)
    np.testing.assert_allclose(at_rest, [0.0, end, 0.0, 0.0], rtol=0, atol=1e-9)
