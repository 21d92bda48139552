"""Forces with a state of their own: their signals, their scan, and as systems."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import equinox as eqx
import hidden_state_rig as truth
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxcam import simulate
from jaxcam.discrepancy.report._hidden import (
    _argument,
    hidden_formula,
    hidden_words,
)
from jaxcam.discrepancy.search._hidden_kinds import (
    HYSTERESIS,
    RELAXATION,
    RESONANCE,
    STIFFENING,
)
from jaxcam.discrepancy.search._hidden_signals import Driven
from jaxcam.discrepancy.search._hidden_state import Hidden
from jaxcam.discrepancy.terms import (
    HiddenForce,
    Hysteresis,
    Motion,
    Relaxation,
    Resonator,
    saved_classes,
    SHARED,
    WithHidden,
    WithTerms,
)
from jaxcam.fitting import read_setup
from jaxcam.models import load_system, save_system


_RIG = Path(__file__).parents[1] / "docs" / "rigs" / "two_stops.toml"
_INTERVAL = 1e-3
_TIME = _INTERVAL * np.arange(3001)
_CORNER = 1.3
NUMBERS = {
    RESONANCE: (7.0, 0.04),
    RELAXATION: (0.12,),
    HYSTERESIS: (0.02, 0.7, 1.5),
    STIFFENING: (0.2, -1.4, 1.2),
}
STRENGTHS = {
    RESONANCE: (900.0, 4.0),
    RELAXATION: (-9.0,),
    HYSTERESIS: (-12.0,),
    STIFFENING: (-12.0,),
}
KINDS = pytest.mark.parametrize("kind", list(NUMBERS), ids=lambda kind: kind.name)


def _position(t):
    """A motion whose velocity jumps once, as in an impact."""
    return 0.05 * np.sin(5.0 * t) + 0.3 * np.abs(t - _CORNER) - 0.02 * t


def _velocity(t):
    return 0.25 * np.cos(5.0 * t) + 0.3 * np.sign(t - _CORNER) - 0.02


def _driven():
    q = _position(_TIME)
    one = np.ones(1)
    return Driven(q[None], 0 * one, _INTERVAL * one, 0.1, float(np.ptp(q)) / 2, "m")


def _hidden(kind, starts=None):
    starts = np.zeros((1, kind.starts)) if starts is None else starts
    return Hidden(kind, _driven(), NUMBERS[kind], STRENGTHS[kind], starts)


def _element(kind):
    numbers = (number.name for number in kind.numbers)
    named = dict(zip(numbers, NUMBERS[kind])) | dict(zip(kind.outputs, STRENGTHS[kind]))
    return kind.element(**named)


@KINDS
def test_the_signal_is_the_force_of_the_element(kind):
    """Against scipy on the equations of the element, to 2e-4 of the largest force."""
    element = _element(kind)
    rate = jax.jit(lambda q, v, z: element.rate(q, v, z))

    def field(t, z):
        return np.asarray(rate(_position(t), _velocity(t), jnp.asarray(z)))

    start = np.zeros(len(element.names))
    if kind is RESONANCE:
        # where it is at rest
        start[0] = _position(0.0) / (2 * math.pi * NUMBERS[kind][0]) ** 2
    states = []
    for a, b in ((0.0, _CORNER), (_CORNER, _TIME[-1])):
        at = _TIME[(_TIME >= a) & (_TIME <= b)]
        flight = solve_ivp(field, (a, b), start, "RK45", at, rtol=1e-7, atol=1e-10)
        start = flight.y[:, -1]
        states.append(flight.y[:, :-1] if b < _TIME[-1] else flight.y)
    states = np.concatenate(states, axis=1)
    expected = np.asarray(jax.vmap(element.push)(jnp.asarray(states.T)))
    found = _hidden(kind).force(NUMBERS[kind])[0]
    assert np.max(np.abs(found - expected)) < 2e-4 * np.max(np.abs(expected))


@KINDS
def test_the_table_holds_the_changes_of_the_force(kind):
    """What a change of each number makes of the force, to second order in it."""
    starts = 1e-3 * np.ones((1, kind.starts))
    hidden = _hidden(kind, starts)
    table = hidden.table[0]
    width = len(kind.outputs)
    here = hidden.force(hidden.numbers)[0]
    free = table[:, SHARED : SHARED + kind.starts] @ starts[0]
    np.testing.assert_allclose(
        table[:, :width] @ np.array(STRENGTHS[kind]) + free, here, atol=1e-12
    )
    for k, number in enumerate(kind.numbers):
        change = 0.02 * kind.reach(number, hidden.numbers)
        numbers = list(hidden.numbers)
        numbers[k] = number.moved(numbers[k], change)
        moved = hidden.force(numbers)[0] - here
        linear = change * table[:, width + k]
        assert np.max(np.abs(moved)) > 0
        assert np.max(np.abs(moved - linear)) < 0.05 * np.max(np.abs(moved))


def test_the_term_reads_its_table_between_samples():
    """A cubic in time is read exactly, of each record its own."""
    term = HiddenForce.empty(2, 40)
    t = 0.5 + 0.01 * np.arange(40)
    table = np.zeros(term.table.shape)
    table[0, :, 0], table[1, :, 0] = t**3, 2 - t**2
    term = eqx.tree_at(
        lambda m: (m.table, m.begin, m.interval, m.shared[0], m.record),
        term,
        tuple(jnp.asarray(x, float) for x in (table, [0.5, 0.5], [0.01, 0.01], 3.0, 1)),
    )
    for record, value in ((0, lambda t: t**3), (1, lambda t: 2 - t**2)):
        one = eqx.tree_at(lambda m: m.record, term, jnp.asarray(float(record)))
        for at in (0.5, 0.5037, 0.71, 0.8862):
            motion = Motion(*(jnp.asarray(x) for x in (at, 0.1, 0.2, 0.3)))
            assert float(one.acceleration(motion)) == pytest.approx(3 * value(at))


def _carried(mass, frequency, damping):
    """A mass on a spring that the cart carries, as a resonance that it drives."""
    w, d = 2 * math.pi * frequency, damping
    return Resonator(
        frequency=frequency,
        ratio=damping,
        by_state=mass * w**4 * (1 - 4 * d**2),
        by_rate=mass * 4 * d * w**3 * (1 - 2 * d**2),
        stiffness=-mass * w**2 * (1 - 4 * d**2),
        damping=-2 * mass * d * w,
    )


def _cart(speed):
    system = read_setup(_RIG).model.system
    values = (
        truth.STIFFNESS, truth.DAMPING, truth.AMPLITUDE,
        truth.LEFT, truth.RIGHT, truth.R_LEFT, truth.R_RIGHT, speed, 0.0,
    )  # fmt: skip
    return eqx.tree_at(
        lambda s: (
            s.stiffness_over_mass, s.damping_over_mass, s.base_amplitude,
            s.left, s.right, s.restitution_left, s.restitution_right, s.speed, s.phase,
        ),
        system,
        values,
    )  # fmt: skip


_W = 2 * math.pi * 9.0
#: the truth, the element, and its state where that of the truth is zero at x = 0.01
SYSTEMS = {
    "resonance": (
        truth.resonance(0.02, 9.0, 0.05),
        _carried(0.02, 9.0, 0.05),
        [4 * 0.05**2 * 0.01 / _W**2, -2 * 0.05 * 0.01 / _W],
    ),
    "relaxation": (
        truth.relaxation(9.0, 0.05),
        Relaxation(time=0.05, by_state=-9.0),
        [0.0],
    ),
    "hysteresis": (
        truth.hysteresis(12.0, 0.012),
        Hysteresis(limit=0.012, beta=0.5, power=1.0, by_state=-12.0),
        [0.0],
    ),
}


@pytest.mark.parametrize("name", list(SYSTEMS))
def test_a_system_with_a_hidden_state_moves_as_scipy_has_it(name):
    """Through several impacts at both stops, to 2e-6 m."""
    hidden, element, begin = SYSTEMS[name]
    speed = 2 * math.pi * 2.3
    times, expected = truth.motion(hidden, speed, 1.5, 5e-3, start=[0.0] * hidden.size)
    system = WithHidden(WithTerms(_cart(speed)), element)
    found = simulate(system, [0.01, 0.3, *begin], 0.0, 1.5)
    assert found.impacts.count >= 4
    assert set(np.asarray(found.impacts.constraint)) == {0, 1}
    np.testing.assert_allclose(found.at(times)[:, 0], expected, atol=2e-6)
    # an impact leaves the hidden state as it is
    before, after = (np.asarray(x) for x in (found.impacts.before, found.impacts.after))
    np.testing.assert_allclose(before[:, 2:], after[:, 2:], rtol=1e-12)


def test_a_saved_system_with_a_hidden_state_is_the_same(tmp_path):
    from jaxcam.models import ImpactOscillator

    element = Relaxation(time=0.3, by_state=-0.5)
    system = WithHidden(WithTerms(ImpactOscillator()), element)
    save_system(system, tmp_path / "model.json")
    again = load_system(tmp_path / "model.json", classes=saved_classes())
    start = jnp.array([-1.0, 0.0, 0.1])
    one, other = (simulate(s, start, 0.0, 3.0) for s in (system, again))
    np.testing.assert_array_equal(one.final, other.final)


def test_a_number_without_meaning_is_refused():
    with pytest.raises(ValueError, match="Relaxation"):
        Relaxation(time=-0.1, by_state=1.0).check()
    with pytest.raises(ValueError, match="loading is 1 or -1"):
        Hysteresis(loading=0)


def test_formulas_say_what_the_elements_are():
    relaxation = Relaxation(time=0.05, by_state=-9.0, stiffness=2.0, middle=0.01)
    assert hidden_formula(relaxation) == (
        "z' = velocity - z/0.05; -9*z + 2*(position - 0.01)"
    )
    resonator = Resonator(frequency=14.0, ratio=0.02, by_state=12.3, by_rate=-0.4)
    assert hidden_formula(resonator) == (
        "z'' + 2*0.02*87.965*z' + 87.965**2*z = position; 12.3*z - 0.4*z'"
    )


@pytest.mark.parametrize("beta, loading", [(0.5, 1), (0.7, 1), (-1.4, -1)])
def test_the_formula_of_a_hysteresis_is_its_equation(beta, loading):
    hysteresis = Hysteresis(0.012, beta, 1.0, by_state=-12.0, loading=loading)
    state, force = hidden_formula(hysteresis).split("; ")
    assert force == "-12*z"
    # the equation of the state, as it is written
    for velocity, z in ((0.3, 0.004), (-0.3, 0.004), (0.3, -0.011)):
        names = {"velocity": velocity, "z": z, "sign": np.sign, "abs": abs}
        written = eval(state.removeprefix("z' = "), names)
        rate = hysteresis.rate(0.0, jnp.asarray(velocity), jnp.asarray([z]))
        assert written == pytest.approx(float(rate[0]))


def test_both_loops_dissipate():
    """Work in a closed cycle of deflection, from the areas of the loops."""
    path = 0.03 * np.sin(np.linspace(0, 4 * np.pi, 2001))
    driven = Driven(path[None], np.zeros(1), np.full(1, 1e-3), 0.0, 0.03, "m")
    for kind, numbers in (
        (HYSTERESIS, (0.02, 0.7, 1.0)),
        (STIFFENING, (0.1, -1.4, 1.0)),
    ):
        ((state, _),) = kind.signals(driven, [numbers])
        z = state[0, 1000:, 0]
        assert np.trapezoid(z, path[1000:]) > 0.05 * np.ptp(z) * np.ptp(path)


def test_an_element_written_in_the_form_of_bouc_and_wen():
    """z' = v - (gamma |v| z |z|^(n-1) + delta v |z|^n), of either sign."""
    gamma, delta, n = 0.8, -1.1, 1.0
    # beta + gamma of the element is c / limit^n
    limit, beta = (-(gamma + delta)) ** (-1 / n), gamma / (gamma + delta)
    element = Hysteresis(limit, beta, n, loading=-1)
    for v, z in ((0.4, 1.3), (-0.4, 1.3), (0.4, -0.7), (-0.4, -0.7)):
        expected = v - gamma * abs(v) * z - delta * v * abs(z)
        found = element.rate(0.0, jnp.asarray(v), jnp.asarray([z]))
        assert float(found[0]) == pytest.approx(expected, rel=1e-12)


def test_the_transfer_of_a_resonance_is_that_of_its_equation():
    """(a + b s) / (s^2 + 2 D w s + w^2) + k + c s, with strict types, to rounding."""
    one = Resonator(
        frequency=3.0,
        ratio=0.1,
        by_state=2.0,
        by_rate=0.3,
        stiffness=5.0,
        damping=0.2,
        middle=0.0,
    )
    frequency = np.array([0.5, 2.9, 8.0])
    s, w = 2j * np.pi * frequency, 2 * np.pi * 3.0
    expected = (2.0 + 0.3 * s) / (s**2 + 0.2 * w * s + w**2) + 5.0 + 0.2 * s
    found = jax.vmap(one.transfer)(jnp.asarray(frequency))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_table_of_a_narrow_resonance_contains_its_peak():
    """A damping ratio of 0.4 %: the peak is reached to 0.1 %."""
    one = Resonator(frequency=14.0, ratio=0.004, by_state=900.0)
    along = _argument(one, 144)
    assert along[0] == pytest.approx(1.4) and along[-1] == pytest.approx(140.0)
    peak = float(jnp.abs(one.transfer(jnp.asarray(14.0))))
    shown = np.max(np.abs(jax.vmap(one.transfer)(jnp.asarray(along))))
    assert shown == pytest.approx(peak, rel=1e-3)


@pytest.mark.usefixtures("unchecked_types")
@pytest.mark.parametrize(("ratio", "resonance"), [(0.04, True), (0.7, False)])
def test_what_hardly_has_a_peak_is_no_resonance(ratio, resonance):
    """With 70 % damping, the peak is 0.02 % higher than the response at rest."""
    number = SimpleNamespace(name="frequency", error=lambda value, error: error)
    hidden: Any = SimpleNamespace(
        kind=SimpleNamespace(numbers=(number,)), changes=("change",)
    )
    found: Any = {"change": SimpleNamespace(stderr=0.5)}
    one = Resonator(frequency=17.26, ratio=ratio, by_state=900.0)
    said = hidden_words(found, hidden, one, "m")
    assert "17.26 +- 0.5 Hz" in said
    assert said.startswith("a resonance") == resonance
