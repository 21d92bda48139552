"""Forms of free functions: what is written is what was fitted."""

import math

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.discrepancy.report import formula_of
from jaxcam.discrepancy.terms import Factor, Family, FREE, Variable, Where


LOW, HIGH, SLIP = -0.4, 1.1, 1e-3
#: numbers of each form: its size, and where it is
NUMBERS = {
    "straight": (2.0,),
    "above": (-3.0, 0.6),
    "below": (3.0, 0.3),
    "step": (1.5, 0.4),
    "window": (1.5, 0.3, 0.7),
    "bump": (0.8, 0.5, 0.1),
    "square": (2.0,),
    "cube": (-2.0,),
    "exponential": (0.5, 3.0),
    "power": (0.6, 2.2),
    "wave": (0.7, 2.3, 0.4),
    "forward": (0.6,),
    "falling": (0.6, 0.2),
    "curved above": (-3.0, 0.6, 1.5),
    "curved below": (3.0, 0.3, 2.0),
    "dead zone": (2.0, 0.5, 0.2),
    "saturating": (1.5, 0.4, 0.1),
    "fast": (-0.8, 0.2),
    "power of speed": (-0.8, 1.5),
    "harmonic 1": (0.6, 0.5),
    "harmonic 2": (0.6, 0.5),
    "harmonic 3": (0.6, 0.5),
    "half turn": (0.6, 3.8),
    "arc": (0.6, 1.2, 0.7),
    "bump in turn": (0.6, 3.7, 0.25),
}

ARGUMENTS = (Variable.POSITION, Variable.VELOCITY, Variable.PHASE, Variable.TIME)


def _family(argument, factor=Factor.ONE, where=Where.FLIGHT):
    low, high = {
        Variable.PHASE: (0.0, 2 * math.pi),
        Variable.TIME: (0.0, HIGH),
    }.get(argument, (LOW, HIGH))
    return Family(where, argument, low, high, factor, middle=0.3, slip=SLIP)


def _forms():
    for argument in ARGUMENTS:
        family = _family(argument)
        for primitive in family.primitives:
            yield pytest.param(family, primitive, id=f"{argument} {primitive.name}")


def _wrapped(x):
    return (x + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("family, primitive", list(_forms()))
def test_the_formula_is_the_function_that_was_fitted(family, primitive):
    """To 0.2 % of its size in 85 % of the range: an edge is smooth over 3 % of it on
    either side to this accuracy, that of a formula is sharp."""
    numbers = np.array(NUMBERS[primitive.name])
    coefficients = np.zeros(21)
    coefficients[: len(numbers)] = numbers
    term = FREE[Where.FLIGHT].of(family, "a", coefficients, primitive).prepared()
    at = np.linspace(family.low, family.high, 400)
    direction = np.tanh(at / SLIP) if family.jumps else 0 * at
    found = np.asarray(term.at(jnp.asarray(at), jnp.asarray(direction)))
    text, _ = formula_of(family, primitive, numbers, "force")
    names = {"max": np.maximum, "sign": np.sign, "wrapped": _wrapped}
    names |= {name: getattr(np, name) for name in ("exp", "cos", "sin", "tanh")}
    written = eval(text, names | {str(family.argument): at})
    size = np.max(np.abs(found))
    close = np.abs(found - written) < 2e-3 * size
    assert size > 0 and np.mean(close) > 0.85


def test_a_form_continues_beyond_the_range_as_its_formula_does():
    """A hundredth of the samples lies outside the range of velocities. To 1e-9."""
    family = _family(Variable.POSITION)
    above = next(one for one in family.primitives if one.name == "above")
    width = HIGH - LOW
    at = jnp.array([HIGH + 0.1 * width])
    coefficients = np.zeros(21)
    coefficients[:2] = -3.0, 0.6
    form = FREE[Where.FLIGHT].of(family, "a", coefficients, above).prepared()
    assert abs(float(form.at(at)[0]) + 3.0 * 0.5) < 1e-9
    # the curve that it replaces has no data there
    curve = FREE[Where.FLIGHT].of(family, "a", coefficients).prepared()
    end = float(curve.at(jnp.array([HIGH]))[0])
    assert abs(float(curve.at(at)[0]) - end) < 1e-12


def test_every_form_has_as_many_numbers_as_it_says():
    for argument in ARGUMENTS:
        for primitive in _family(argument).primitives:
            assert primitive.count == len(NUMBERS[primitive.name])
            assert len(primitive.scales) == primitive.count - 1


def test_a_form_is_refused_where_its_place_is_outside_the_data():
    bump = next(p for p in _family(Variable.TIME).primitives if p.name == "bump")
    assert bump.within((0.3, 0.8, 2.0)) and not bump.within((0.3, 1.4, 2.0))


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("window", (1.0, 0.7, 0.3)),
        ("saturating", (1.5, 0.4, -0.1)),
        ("dead zone", (2.0, 0.9, 0.3)),
        ("dead zone", (2.0, 0.5, -0.2)),
        ("curved above", (2.0, 0.5, -0.5)),
        ("fast", (1.0, 0.7)),
        ("power of speed", (1.0, -0.5)),
    ],
)
def test_a_form_with_parameters_that_make_no_sense_is_refused(name, numbers):
    """Edges in the wrong order or outside, negative lengths and exponents."""
    family = _family(Variable.VELOCITY)
    form = next(one for one in family.primitives if one.name == name)
    assert form.within(NUMBERS[name]) and not form.within(numbers)


def test_what_falls_from_the_beginning_is_said_to_fall():
    family = _family(Variable.TIME, where=Where.IMPACT)
    power = next(one for one in family.primitives if one.name == "power")
    text, words = formula_of(family, power, np.array([-0.1, 2.0]), "restitution")
    assert text == f"exp(-0.1*(time/{HIGH:.4g})**2)"
    assert words.startswith(
        "a coefficient of restitution that falls as the time to the power 2"
    )


def test_an_elastic_stop_is_said_to_be_one():
    family = _family(Variable.POSITION)
    above = next(one for one in family.primitives if one.name == "above")
    text, words = formula_of(family, above, np.array([-30.0, 0.5]), "force")
    assert text == "-20*max(position - 0.35, 0)"
    assert "pushes back above 0.35 rad with a stiffness of 20 1/s^2" in words
    assert "as an elastic stop would" in words
    pulled = formula_of(family, above, np.array([30.0, 0.5]), "force")[1]
    assert "elastic stop" not in pulled and "pulls above 0.35 rad" in pulled


def test_damping_in_a_zone_is_a_formula_of_two_arguments():
    family = _family(Variable.POSITION, Factor.VELOCITY)
    window = next(one for one in family.primitives if one.name == "window")
    text, words = formula_of(family, window, np.array([-0.3, 0.2, 0.6]), "force")
    assert text == "-0.3*(-0.1 < position)*(position < 0.5)*velocity"
    assert words.startswith("damping that acts only between position -0.1 and 0.5")
