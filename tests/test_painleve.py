"""Configurations in which friction makes the contact force ambiguous or impossible."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_frictional_impact import integrated, KINDS, Rod
from textbook_systems import parameters

import jaxcam
from jaxcam.hybrid import flow, RESULTS, SwitchedSystem
from jaxcam.hybrid.codes import FINISHED, PAINLEVE
from jaxcam.hybrid.surface._frictional_impact import impulses, Rates


# the angle at which a uniform rod needs the smallest coefficient, 4/3: from the
# vertical, tan = 1/2
STEEPEST = np.arctan(0.5)


def _rod(friction):
    given: Any = parameters(friction=friction, restitution=0.6)
    return Rod(**given)


def _sliding(angle, slip, turns):
    """A rod whose lower end slides at velocity `slip`."""
    across, up = slip + np.cos(angle) * turns, -np.sin(angle) * turns
    return np.array([0.0, np.cos(angle), angle, across, up, turns])


def _range(friction):
    """The angles between which it is a Painleve configuration: 1 + 4 tan^2 = 3 mu
    tan.
    """
    return np.sort(np.arctan(np.roots([4.0, -3.0 * friction, 1.0]).real))


def _ends(run):
    assert run.result == RESULTS[RESULTS.painleve]
    return float(np.max(run.steps.time, initial=float(run.t0)))


@pytest.mark.parametrize("slip", [2.0, -2.0])
def test_the_critical_coefficient_of_a_rod_is_four_thirds(slip):
    """To 1e-6 on either side; slipping forwards, it is never one."""
    for share, fails in ((1 - 1e-6, False), (1 + 1e-6, slip < 0)):
        start = _sliding(STEEPEST, slip, 0.0)
        run = jaxcam.simulate(_rod(4 / 3 * share), start, 0.0, 0.02)
        if fails:
            assert _ends(run) == 0.0
            np.testing.assert_array_equal(run.final, start)
        else:
            assert run.successful, run.result


def test_a_rod_that_turns_into_the_range_ends_at_its_edge():
    """Its end sticks, and would slip ambiguously from there: angle to 1e-9."""
    start = _sliding(0.2, -5.0, 1.0)
    run = jaxcam.simulate(_rod(1.4), start, 0.0, 2.0)
    assert _ends(run) > 0.2
    np.testing.assert_allclose(run.final[2], -_range(1.4)[0], atol=1e-8)
    below = jaxcam.simulate(_rod(1.33), start, 0.0, 0.5)
    assert below.successful and np.min(below.steps.state[:, 2]) < -STEEPEST


def test_dynamic_jam_ends_where_the_compliance_vanishes():
    """A slipping rod approaches the edge of the range: angle to 1e-6."""
    run = jaxcam.simulate(_rod(3.0), _sliding(1.2, -20.0, -4.0), 0.0, 2.0)
    assert _ends(run) > 0 and run.switches is not None
    assert not int(run.switches.count)
    np.testing.assert_allclose(run.final[2], _range(3.0)[1], atol=1e-6)


class Coupled(SwitchedSystem):
    """A contact whose slip is coupled with its normal motion; state (x, y, vx, vy).

    The normal acceleration is pull (t - 1) + (1 - grip t / 2) q with the force q.
    """

    pull: Any = 1.0
    grip: Any = 2.0

    def switching(self, t, state):
        return state[2]

    def branch(self, t, state, sides):
        zero = 0.0 * state[0]
        return jnp.stack([state[2], state[3], zero, zero - self.pull * (1 - t)])

    def gap(self, t, state):
        return state[1]

    def impact(self, t, state):
        return state.at[2:].add(-state[3] * jnp.array([0.5, 1.0]))

    def contact_friction(self, t, state, sides):
        push = -self.grip * t * sides[0]
        return jnp.stack([0.0, 0.0, push, push / 2])


START = np.array([0.0, 0.0, 3.0, 0.0])


def test_the_time_at_which_the_force_becomes_ambiguous():
    """Until t = 1, the force is constant; state and time in closed form, to 1e-8."""
    run = jaxcam.simulate(Coupled(**parameters(grip=2.0)), START, 0.0, 2.0)
    np.testing.assert_allclose(_ends(run), 1.0, atol=2e-9)
    expected = [3 + 1 / 4 - 1 / 3, 0, 3 + 1 / 2 - 1, 0]
    np.testing.assert_allclose(run.final, expected, atol=1e-8)


def test_without_enough_friction_it_lifts_off():
    """With grip 1.9, the contact ends when the pull vanishes, at t = 1."""
    run = jaxcam.simulate(Coupled(**parameters(grip=1.9)), START, 0.0, 1.04)
    assert run.successful, run.result
    assert list(run.contacts.released) == [True]
    np.testing.assert_allclose(run.contacts.end, [1.0], atol=1e-9)


def test_batches_and_compiled_programs_carry_the_code():
    @eqx.filter_jit
    def codes(grips):
        systems = Coupled(jnp.ones_like(grips), grips)
        return jax.vmap(lambda s: flow(s, jnp.asarray(START), 0.0, 1.04))(systems)

    ends = codes(jnp.array([1.0, 1.9, 2.0, 2.5]))
    assert [int(c) for c in ends.code] == [FINISHED, FINISHED, PAINLEVE, PAINLEVE]
    assert np.all(np.isfinite(ends.state))


@pytest.mark.slow
def test_the_code_of_a_traced_simulation():
    system = Coupled(**parameters(grip=2.0))

    @jax.jit
    def code(pull):
        traced = eqx.tree_at(lambda s: s.pull, system, pull)
        return jaxcam.simulate(traced, START, 0.0, 2.0, max_steps=512).code

    assert int(code(jnp.asarray(1.0))) == PAINLEVE


def _jamming(number):
    """Random impacts in which the body slips in a Painleve configuration."""
    rng = np.random.default_rng(3)
    across = rng.uniform(0.8, 3, number)
    coupling = rng.uniform(0.3, 0.95, number) * np.sqrt(across)
    coupling = coupling * rng.choice([-1.0, 1.0], number)
    friction = rng.uniform(1.0, 2.0, number) / np.abs(coupling)
    rates = Rates(
        (coupling - friction * across, 1 - friction * coupling),
        (coupling + friction * across, 1 + friction * coupling),
    )
    slip, approach = rng.uniform(0, 1.5, number), -rng.uniform(0.2, 1.0, number)
    mass = np.linalg.inv(
        np.stack(
            [np.stack([across, coupling]), np.stack([coupling, 1 + 0 * across])]
        ).transpose(2, 0, 1)
    )
    return np.sign(coupling), slip, approach, rng.random(number), rates, mass


@pytest.mark.parametrize("kind", KINDS)
def test_impacts_in_such_a_configuration(kind):
    """The impulse stops the slip, and ends: against integration, to 1e-9.

    With the energetic coefficient, none adds energy.
    """
    side, slip, approach, restitution, rates, mass = _jamming(24)
    assert np.all(np.where(side > 0, rates[0][1], rates[1][1]) <= 0)
    found = impulses(side, slip, approach, restitution, rates, kind)
    before = np.stack([side * slip, approach], axis=1)
    change = [
        np.asarray(found.positive) * rates[0][i]
        + np.asarray(found.negative) * rates[1][i]
        for i in (0, 1)
    ]
    after = before + np.stack(change, axis=1)
    for k in range(len(side)):
        here = tuple(tuple(float(a[k]) for a in pair) for pair in rates)
        expected = integrated(side[k], slip[k], approach[k], restitution[k], here, kind)
        np.testing.assert_allclose([part[k] for part in found], expected, atol=1e-9)
    if kind == "energetic":
        energies = [np.einsum("ki,kij,kj->k", u, mass, u) for u in (before, after)]
        assert np.all(energies[1] <= energies[0] + 1e-12)
