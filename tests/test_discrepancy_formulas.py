"""Forms of free functions: what is written is what was fitted."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.discrepancy.report import formula_of
from jaxcam.discrepancy.terms import Factor, Family, FREE, sum_of, Variable, Where
from jaxcam.discrepancy.terms._primitives import OF_FACTORS


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
    "parabola": (2.0, 0.3),
    "cube": (-2.0,),
    "exponential": (0.5, 3.0),
    "power": (0.6, 2.2),
    "settling": (0.6, 3.0),
    "wave": (0.7, 2.3, 0.4),
    "forward": (0.6,),
    "backward": (0.6,),
    "dry": (-0.4,),
    "falling": (0.6, 0.2),
    "curved above": (-3.0, 0.6, 1.5),
    "curved below": (3.0, 0.3, 2.0),
    "dead zone": (2.0, 0.5, 0.2),
    "saturating": (1.5, 0.4, 0.1),
    "detent": (-1.2, 0.6, 0.1),
    "fast": (-0.8, 0.2),
    "power of speed": (-0.8, 1.5),
    "harmonic 1": (0.6, 0.5),
    "harmonic 2": (0.6, 0.5),
    "harmonic 3": (0.6, 0.5),
    "half turn": (0.6, 3.8),
    "arc": (0.6, 1.2, 0.7),
    "bump in turn": (0.6, 3.7, 0.25),
}

SUMS = {
    Variable.POSITION: [("above", "bump"), ("window", "straight", "dead zone")],
    Variable.VELOCITY: [
        ("forward", "cube"),
        ("falling", "power of speed"),
        ("dry", "falling", "fast"),
    ],
    Variable.PHASE: [("harmonic 1", "harmonic 3"), ("arc", "harmonic 2", "half turn")],
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
        forms = {one.name: one for one in family.summands}
        for names in SUMS.get(argument, ()):
            both = sum_of([forms[name] for name in names], [1.0] * len(names))
            yield pytest.param(family, both, id=f"{argument} {both.name}")
    damping = _family(Variable.POSITION, Factor.VELOCITY)
    for primitive in OF_FACTORS:
        yield pytest.param(damping, primitive, id=f"damping {primitive.name}")


def _wrapped(x):
    return (x + np.pi) % (2 * np.pi) - np.pi


@pytest.mark.parametrize("family, primitive", list(_forms()))
def test_the_formula_is_the_function_that_was_fitted(family, primitive):
    """To 0.2 % of its size in 85 % of the range: an edge is smooth over 3 % of it on
    either side to this accuracy, that of a formula is sharp."""
    parts = primitive.parts or (primitive,)
    numbers = np.concatenate([NUMBERS[part.name] for part in parts])
    coefficients = np.zeros(21)
    coefficients[: len(numbers)] = numbers
    term = FREE[Where.FLIGHT].of(family, "a", coefficients, primitive).prepared()
    at = np.linspace(family.low, family.high, 400)
    direction = np.tanh(at / SLIP) if family.jumps else 0 * at
    found = np.asarray(term.at(jnp.asarray(at), jnp.asarray(direction)))
    text, _ = formula_of(family, primitive, numbers, "force")
    names = {"max": np.maximum, "sign": np.sign, "wrapped": _wrapped}
    names |= {name: getattr(np, name) for name in ("exp", "cos", "sin", "tanh")}
    factors = {"velocity": 1.0}
    written = eval(text, names | factors | {str(family.argument): at})
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


@pytest.mark.parametrize("steps", [20, 60])
def test_the_derivative_by_an_edge_is_seen_by_steps_longer_than_the_edge(steps):
    """Simpson's rule, as in a Runge-Kutta step, gives the change of the impulse of a
    jump that moves within a step: that of the jump, to 4 %."""
    stride = HIGH / steps
    family = dataclasses.replace(_family(Variable.TIME), stride=stride)
    step = next(one for one in family.primitives if one.name == "step")
    at = jnp.linspace(family.low, family.high, 2 * steps + 1)
    weights = np.tile([1.0, 4.0, 1.0, 0.0], steps).reshape(steps, 4)[:, :3] * stride / 6

    def values(place):
        numbers = [1.5, place, *[0.0] * 19]
        return FREE[Where.FLIGHT].of(family, "a", numbers, step).prepared().at(at)

    places = 0.4 + np.arange(8) / 8 / steps
    slopes = np.asarray(jax.vmap(jax.jacfwd(values))(jnp.asarray(places)))
    impulses = sum(slopes[:, k::2][:, :steps] @ weights[:, k] for k in (0, 1, 2))
    assert impulses == pytest.approx(-1.5 * HIGH, rel=0.04)
    # the values are not softened: 3 % of the range from the edge they are those of it
    found = np.asarray(values(jnp.asarray(0.4)))
    far = np.abs(np.asarray(at) / HIGH - 0.4) > 0.03
    exact = np.where(at > 0.4 * HIGH, 1.5, 0.0)
    assert found[far] == pytest.approx(exact[far], abs=1e-2)


def _slope(function, at, h=1e-6):
    """Its derivative, and the central difference of its values."""
    slope = float(jax.grad(function)(jnp.asarray(at)))
    difference = float(function(jnp.asarray(at + h)) - function(jnp.asarray(at - h)))
    return slope, difference / (2 * h)


def _form(name, stride, argument=Variable.TIME):
    family = dataclasses.replace(_family(argument), stride=stride)
    form = next(one for one in family.primitives if one.name == name)
    numbers = [*NUMBERS[name], *[0.0] * (21 - form.count)]
    return FREE[Where.FLIGHT].of(family, "a", numbers, form)


def test_outside_a_fit_the_derivatives_are_those_of_the_values():
    """To 1e-6 of a central difference, beside an edge; also if it was prepared."""
    soft, at = _form("step", HIGH / 20), 0.4 * HIGH + 3e-3
    slope, expected = _slope(soft.prepared().at, at)
    assert abs(slope - expected) > 0.1 * abs(expected)
    for one in (soft.exact().prepared(), soft.prepared().exact()):
        slope, expected = _slope(one.at, at)
        assert slope == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", ["above", "dead zone", "curved above"])
def test_the_derivative_by_a_knee_changes_over_an_integration_step(name):
    """If it jumped between the evaluations of a step, a fit of the knee would stop."""
    stride = HIGH / 20
    family = dataclasses.replace(_family(Variable.POSITION), stride=stride)
    form = next(one for one in family.primitives if one.name == name)
    numbers = {"above": [1.0, 0.6], "dead zone": [1.0, 0.4, 0.2]}
    start = numbers.get(name, [1.0, 0.6, 1.0])
    knee = family.low + 0.6 * (family.high - family.low)
    at = knee + stride * jnp.array([-1.5, -0.4, 0.4, 1.5])

    def values(place):
        moved = [start[0], place, *start[2:], *[0.0] * (21 - form.count)]
        return FREE[Where.FLIGHT].of(family, "a", moved, form).prepared().at(at)

    slopes = jax.jacfwd(values)(jnp.asarray(start[1]))
    assert slopes == pytest.approx([0.0, -0.18, -0.82, -1.0], abs=0.05)


@pytest.mark.parametrize("name", ["wave", "bump"])
def test_a_form_without_edges_has_the_derivatives_of_its_values(name):
    """To 1e-6 of a central difference."""
    form = _form(name, HIGH / 10).prepared()
    for at in (0.41, 0.52, 0.83):
        slope, expected = _slope(form.at, at)
        assert slope == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_the_edges_of_a_narrow_window_are_not_averaged_together():
    """The derivative by its height keeps four fifths of its area within the window."""
    family = dataclasses.replace(_family(Variable.TIME), stride=HIGH / 5)
    window = next(one for one in family.primitives if one.name == "window")
    at = jnp.linspace(family.low, family.high, 1000)

    def values(size):
        numbers = [size, 0.4, 0.5, *[0.0] * 18]
        return FREE[Where.FLIGHT].of(family, "a", numbers, window).prepared().at(at)

    slopes = np.asarray(jax.jacfwd(values)(jnp.asarray(1.0)))
    inside = (np.asarray(at) > 0.35 * HIGH) & (np.asarray(at) < 0.55 * HIGH)
    assert np.sum(slopes[inside]) > 0.8 * np.sum(slopes)
    assert np.sum(slopes) / 1000 == pytest.approx(0.1, rel=0.02)


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
        # steps in disguise
        ("curved above", (2.0, 0.5, 0.01)),
        ("saturating", (1.5, 0.4, 1e-3)),
        ("fast", (1.0, 0.7)),
        ("power of speed", (1.0, -0.5)),
    ],
)
def test_a_form_with_parameters_that_make_no_sense_is_refused(name, numbers):
    """Edges in the wrong order or outside; lengths and exponents that are negative, or
    so small that the form is a step.
    """
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


def test_a_detent_pulls_and_a_barrier_pushes():
    """Towards its place, with its greatest force at the stated distance."""
    family = _family(Variable.POSITION)
    detent = next(one for one in family.primitives if one.name == "detent")
    text, words = formula_of(family, detent, np.array([-2.0, 0.6, 0.1]), "force")
    assert (
        "pulls towards position 0.5 rad, most strongly at a distance of 0.15" in words
    )
    at = 0.5 + 0.15 * np.linspace(-3, 3, 601)
    force = eval(text, {"exp": np.exp, "position": at})
    assert at[np.argmax(force)] == pytest.approx(0.35, abs=2e-3)
    assert force.max() == pytest.approx(2.0, rel=1e-3)
    words = formula_of(family, detent, np.array([2.0, 0.6, 0.1]), "force")[1]
    assert "pushes away from position 0.5 rad" in words


def test_damping_in_a_zone_is_a_formula_of_two_arguments():
    family = _family(Variable.POSITION, Factor.VELOCITY)
    window = next(one for one in family.primitives if one.name == "window")
    text, words = formula_of(family, window, np.array([-0.3, 0.2, 0.6]), "force")
    assert text == "-0.3*(-0.1 < position)*(position < 0.5)*velocity"
    assert words.startswith("damping that acts only between position -0.1 and 0.5 rad:")


def test_words_have_units_where_the_argument_has_one():
    """A time in s, a speed in the unit of the motion, and nothing for a pure number."""
    step = next(f for f in _family(Variable.TIME).primitives if f.name == "step")
    numbers = np.array([0.3, 0.5])
    for variable, motion, place in [
        (Variable.TIME, "mm", "time 0.55 s:"),
        (Variable.VELOCITY, "mm", "velocity 0.35 mm/s:"),
        (Variable.APPROACH, "rad", "speed 0.35 rad/s:"),
        (Variable.POSITION, "-", "position 0.35:"),
    ]:
        family = dataclasses.replace(_family(variable), motion_unit=motion)
        words = formula_of(family, step, numbers, "force")[1]
        assert f"sets in at {place}" in words


def test_a_formula_has_no_double_signs_and_no_phase_just_below_a_turn():
    """Amplitudes are positive, and a phase that vanishes is written as zero."""
    family = _family(Variable.PHASE)
    forms = {one.name: one for one in family.primitives}
    both = sum_of([forms["harmonic 1"], forms["harmonic 3"]], [1.0, 1.0])
    numbers = np.array([0.5, -2e-4, -0.3, 0.4])
    text, _ = formula_of(family, both, numbers, "force")
    assert text == "0.5*cos(phase + 0.0002) + 0.3*cos(3*phase - 3.542)"
    family = _family(Variable.POSITION)
    straight = next(one for one in family.primitives if one.name == "straight")
    text, _ = formula_of(family, straight, np.array([1.5]), "force")
    assert text == "1*(position + 0.4)"


def test_a_wavelength_is_positive():
    """A cosine with the negative wave number of its fit is the same oscillation."""
    family = _family(Variable.POSITION)
    wave = next(one for one in family.primitives if one.name == "wave")
    written = formula_of(family, wave, np.array([0.5, 2.0, 0.4]), "force")
    assert formula_of(family, wave, np.array([0.5, -2.0, -0.4]), "force") == written
    assert "with a wavelength of 0.75" in written[1]


@pytest.mark.parametrize(
    ("name", "numbers"), [("wave", (0.7, 2.3, 0.4)), ("straight", (2.0,))]
)
def test_a_formula_does_not_subtract_zero(name, numbers):
    """Time begins at zero."""
    family = Family(Where.CONTACT, Variable.TIME, 0.0, 6.0)
    form = next(one for one in family.primitives if one.name == name)
    text, words = formula_of(family, form, np.array(numbers), "surface")
    assert "*time" in text and " - 0)" not in text and text in words
