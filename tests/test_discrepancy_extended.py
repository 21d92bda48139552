"""Terms that few rigs lack: edges, directions, speeds and places of their own."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from textbook_stage import Stage, staged

from jaxcam.discrepancy import diagnose, library, Policy
from jaxcam.discrepancy.search._placing import _signed_gain
from jaxcam.discrepancy.search._question import by_listing
from jaxcam.discrepancy.terms import (
    Motion,
    MotionScales,
    saved_classes,
    Where,
    WithTerms,
)
from jaxcam.fitting import Input, Parameter, Sensor
from jaxcam.models.saved import load_system, save_system
from jaxcam.recordings import Recording, segment


SCALES = MotionScales(-0.2, 0.6, 3.0, 12.0, 0.01)
TERMS = {
    term.name: term.scaled(SCALES)
    for term in library(extended=True)
    if term.name not in {one.name for one in library()}
}


def moving(position, velocity) -> Motion:
    t = jnp.asarray(0.3)
    return Motion(t, *(jnp.asarray(x, dtype=float) for x in (position, velocity)), t)


def test_the_usual_library_is_a_part_of_the_extended_one():
    usual = [term.name for term in library()]
    more = [term.name for term in library(extended=True)]
    assert more[: len(usual)] == usual
    assert len(set(more)) == len(more)
    strengths = [s.name for t in library(extended=True) for s in t.strengths()]
    assert len(set(strengths)) == len(strengths)


@pytest.mark.parametrize("name", TERMS)
def test_without_strength_nothing_changes(name):
    term = TERMS[name]
    for position in (-0.2, 0.25, 0.59):
        for velocity in (-2.0, 0.0, 2.0):
            motion = moving(position, velocity)
            assert float(term.acceleration(motion)) == 0.0
            assert float(term.restitution(jnp.asarray(0.7), motion)) == 1.0


@pytest.mark.parametrize(
    ("name", "values", "position", "velocity", "expected"),
    [
        ("constant_force", {"f0": 2.0}, 0.1, 1.0, 2.0),
        # the middle of the positions is 0.2
        ("linear_spring", {"k1": 5.0}, 0.5, 1.0, -1.5),
        ("bilinear_spring", {"kb": -4.0, "knee": 0.3}, 0.5, 1.0, 0.8),
        ("bilinear_spring", {"kb": -4.0, "knee": 0.3}, 0.2, 1.0, 0.0),
        ("stop_above", {"ka": 10.0, "edge_a": 0.4}, 0.3, 2.0, 0.0),
        ("stop_above", {"ka": 10.0, "edge_a": 0.4}, 0.5, 2.0, -1.0),
        ("stop_above", {"da": 10.0, "edge_a": 0.4}, 0.5, 2.0, -2.0),
        ("stop_above", {"la": 10.0, "edge_a": 0.4}, 0.5, -2.0, 1.0),
        # of the half range, 0.4, friction begins within 0.02
        ("stop_above", {"ra": 2.0, "edge_a": 0.4}, 0.3, 1.0, 0.0),
        ("stop_above", {"ra": 2.0, "edge_a": 0.4}, 0.408, 1.0, -2 * (1 - np.exp(-1))),
        ("stop_above", {"ra": 2.0, "edge_a": 0.4}, 0.6, -1.0, 2 * (1 - np.exp(-25))),
        ("stop_below", {"rd": 2.0, "edge_b": 0.2}, -0.2, 1.0, -2 * (1 - np.exp(-50))),
        ("stop_below", {"kd": 10.0, "edge_b": 0.0}, 0.1, 2.0, 0.0),
        ("stop_below", {"kd": 10.0, "edge_b": 0.0}, -0.1, 2.0, 1.0),
        ("stop_below", {"dd": 10.0, "edge_b": 0.0}, -0.1, -2.0, 2.0),
        ("stop_below", {"ld": 10.0, "edge_b": 0.0}, -0.1, 2.0, -1.0),
        ("damping_forwards", {"cf": 3.0}, 0.0, 2.0, -6.0),
        ("damping_forwards", {"cf": 3.0}, 0.0, -2.0, 0.0),
        ("damping_backwards", {"cb": 3.0}, 0.0, -2.0, 6.0),
        ("damping_backwards", {"cb": 3.0}, 0.0, 2.0, 0.0),
        ("friction_forwards", {"ff": 3.0}, 0.0, 2.0, -3.0),
        ("friction_forwards", {"ff": 3.0}, 0.0, -2.0, 0.0),
        ("friction_backwards", {"fb": 3.0}, 0.0, -2.0, 3.0),
        ("friction_backwards", {"fb": 3.0}, 0.0, 2.0, 0.0),
        ("stribeck_curve", {"se": 2.0, "vs": 1.0}, 0.0, -1.0, 2.0 * np.exp(-1.0)),
        # places are -1 and 1 at the ends
        ("uneven_friction", {"u1": 2.0, "u2": 1.0}, 0.6, 1.0, -3.0),
        ("uneven_friction", {"u1": 2.0, "u2": 1.0}, -0.2, 1.0, 1.0),
    ],
)
def test_forces_are_those_of_the_table(name, values, position, velocity, expected):
    term = dataclasses.replace(TERMS[name], **values)
    found = float(term.acceleration(moving(position, velocity)))
    assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("power", [0.25, -0.1])
def test_a_restitution_is_a_power_of_the_approach_speed(power):
    term = dataclasses.replace(TERMS["restitution_power"], rp=power)
    at = moving(0.0, -1.0)
    factors = [float(term.restitution(jnp.asarray(v), at)) for v in (3.0, 1.5, 0.3)]
    assert factors == pytest.approx([1.0, 0.5**-power, 0.1**-power], rel=1e-12)
    # where there is hardly an impact left, it stays a number
    assert np.isfinite(float(term.restitution(jnp.asarray(0.0), at)))


@pytest.mark.parametrize(
    ("name", "values", "edge"),
    [
        ("stop_above", {"ka": 10.0, "da": 3.0, "la": 2.0, "edge_a": 0.4}, 0.4),
        ("stop_below", {"kd": 10.0, "dd": 3.0, "ld": 2.0, "edge_b": 0.0}, 0.0),
    ],
)
def test_a_stop_takes_energy_out_of_a_motion_into_it_and_back(name, values, edge):
    sharp = tuple(SCALES._replace(slip=1e-6))
    term = dataclasses.replace(TERMS[name], **values, ranges=sharp)
    angle = np.linspace(0, 2 * np.pi, 4001)[:-1]
    position, velocity = edge + 0.1 * np.sin(angle), 0.1 * np.cos(angle)

    def work_of(term):
        motion = moving(position, velocity)
        power = np.asarray(term.acceleration(motion)) * velocity
        return float(np.mean(power)) * 2 * np.pi

    work = work_of(term)
    lossy = [one for one in values if one[0] in "dl"]
    elastic = dataclasses.replace(term, **dict.fromkeys(lossy, 0.0))
    assert work_of(elastic) == pytest.approx(0.0, abs=1e-9)
    # of the depth d = r sin(a) and v = r cos(a) over half a turn: the integral of
    # d v^2 is 2 r^3 / 3, and that of d |v| is r^2
    assert work == pytest.approx(-(3.0 * 2 * 0.1**3 / 3 + 2.0 * 0.1**2), rel=1e-3)


def test_scales_are_those_of_the_recordings():
    """A motion a hundred times smaller has sizes and places a hundred times smaller."""
    small = MotionScales(*(0.01 * x for x in SCALES))
    for term in library(extended=True):
        large_one, small_one = term.scaled(SCALES), term.scaled(small)
        for start, other in zip(large_one.starts(), small_one.starts(), strict=True):
            for name, value in start.items():
                assert other[name] == pytest.approx(0.01 * value, abs=1e-15)
    ratio = {
        one.name: one.size / other.size
        for name, term in TERMS.items()
        for one, other in zip(term.strengths(), term.scaled(small).strengths())
    }
    for name in ("f0", "ff", "fb", "se", "u1", "u2", "ra", "edge_a", "knee", "vs"):
        assert ratio[name] == pytest.approx(100.0)
    for name in ("k1", "kb", "ka", "cf", "cb", "la", "rp"):
        assert ratio[name] == pytest.approx(1.0)
    assert ratio["da"] == pytest.approx(0.01)


@pytest.mark.parametrize("name", [n for n, t in TERMS.items() if t.starts()])
def test_places_are_looked_for_within_what_was_visited(name):
    term = TERMS[name]
    (inner,) = (one for one in term.strengths() if one.inner)
    values = [start[inner.name] for start in term.starts()]
    assert all(inner.lower < value < inner.upper for value in values)
    (bounds,) = (p for p in term.parameters(0) if p.name == inner.name)
    assert (bounds.lower, bounds.upper) == (inner.lower, inner.upper)


def test_the_gain_of_a_placed_term_minds_the_signs_of_its_strengths():
    # two strengths that look alike: the second one wants to be negative
    rest = np.array([[1.0, 0.6], [0.6, 1.0]])
    left = rest @ np.array([3.0, -2.0])
    free, both = np.full(2, -np.inf), np.zeros(2)
    above = np.full(2, np.inf)
    assert _signed_gain(rest, left, free, above, 1e-8) == pytest.approx(
        left @ np.linalg.solve(rest, left)
    )
    assert _signed_gain(rest, left, both, above, 1e-8) == pytest.approx(left[0] ** 2)
    assert _signed_gain(rest, -np.abs(left), both, above, 1e-8) == 0.0


def test_a_place_is_looked_for_on_the_first_coordinate():
    elsewhere = dataclasses.replace(TERMS["stop_above"], coordinate=1)
    with pytest.raises(ValueError, match="'stop_above' defines `starts`"):
        by_listing((elsewhere,))
    terms, unlisted = by_listing(tuple(TERMS.values()))
    assert len(terms) == len(TERMS) and not unlisted


def test_a_system_with_extended_terms_is_saved_and_read_again(tmp_path):
    terms = tuple(TERMS.values())
    stop = dataclasses.replace(TERMS["stop_above"], ka=10.0, edge_a=0.4)
    system = WithTerms(Stage(), (*terms, stop))
    save_system(system, tmp_path / "system.json")
    again = load_system(tmp_path / "system.json", classes=(*saved_classes(), Stage))
    state, t = jnp.array([0.5, 1.0]), jnp.asarray(0.2)
    assert again.vector_field(t, state) == pytest.approx(
        np.asarray(system.vector_field(t, state)), abs=1e-14
    )
    assert again.terms[-1].scales == SCALES  # pyright: ignore


@pytest.mark.slow
def test_a_stop_is_found_placed_and_modelled():
    """A surface that a stage touches, with its edge, stiffness and loss."""
    edge, stiffness, loss = 0.012, 600.0, 150.0
    noise, runs = 2e-6, []
    for seed in range(2):
        time, voltage, position = staged(seed, edge, stiffness, loss)
        rng = np.random.default_rng(seed + 10)
        channels = {
            "position_m": position + noise * rng.standard_normal(len(position)),
            "voltage_V": voltage,
        }
        run = Recording(f"run{seed}", time, channels)
        runs.append(segment(run, "position_m", noise=noise))
    offered = ("stop_above", "coulomb_friction", "nonlinear_spring")
    found = diagnose(
        Stage(),
        runs,
        [t for t in library(turned=False, extended=True) if t.name in offered],
        sensors={"position_m": Sensor(0, noise=noise)},
        parameters=[
            Parameter("gain", lambda m: m.system.gain, scale=1.0, lower=0.0),
            Parameter("stiffness", lambda m: m.system.stiffness, scale=10.0, lower=0.0),
            Parameter("damping", lambda m: m.system.damping, scale=0.3, lower=0.0),
        ],
        drive=Input("voltage_V", lambda system: system.voltage),
        policy=Policy(functions=0),
    )
    assert found.names == ("stop_above",)
    (effect,) = found.effects
    assert effect.where == Where.FLIGHT
    for name, truth in (("ka", stiffness), ("edge_a", edge), ("la", loss)):
        one = effect.parameters[name]
        # corners and edges that steps cross cost a share of the accuracy
        assert one.value == pytest.approx(truth, abs=5 * one.stderr + 0.02 * truth)
    assert found.heldout_after < 0.05 * found.heldout_before
