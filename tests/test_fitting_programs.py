"""Compiled programs of a fit, and what is held out of it."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fitting_rigs import DraggedBall

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.evidence._held_out import folds_of
from jaxcam.discrepancy.search import _extended
from jaxcam.fitting import fit, Model, Parameter, Problem, Sensor
from jaxcam.fitting.engine import (
    _linearise,
    cost_by_recording,
    free_columns,
    of_record,
    Weights,
)
from jaxcam.fitting.engine._linearise import _linearise_all, assemble_one, Costs
from jaxcam.fitting.engine._predict import smallest_gap
from jaxcam.fitting.engine._seen_directly import seen_directly
from jaxcam.recordings import record, segment


NOISE = 1e-3
SENSORS = {"height_m": Sensor(0, noise=NOISE)}
TRUE = DraggedBall(gravity=9.7, drag=0.12, restitution=0.75)
PARAMETERS = [
    Parameter("gravity", lambda m: m.system.gravity, tolerance=0.5),
    Parameter("drag", lambda m: m.system.drag, lower=0.0, scale=0.1),
    Parameter("restitution", lambda m: m.system.restitution, upper=1.0),
]


class Room(DraggedBall):
    """A ball that never reaches the ceiling of its room."""

    def gap(self, t, state):
        return jnp.stack([state[0], 3.0 - state[0]])


@pytest.fixture(scope="module")
def rooms():
    runs = []
    for name, height in (("a", 1.0), ("b", 1.3)):
        run = record(
            TRUE,
            SENSORS,
            2.0,
            rng=np.random.default_rng(round(10 * height)),
            state=jnp.array([height, 0.0]),
            interval=2e-3,
            name=name,
        )
        floor = np.zeros(len(run))
        runs.append(segment(run, "height_m", floor, noise=NOISE, restitution=0.8))
    return Problem.build(Model(Room(), SENSORS), runs, PARAMETERS)


@pytest.fixture(scope="module")
def found(rooms):
    return fit(rooms)


def test_the_smallest_gap_has_the_slopes_of_the_gap_that_is_smallest():
    """Where two gaps are equal, the slopes of one of them: `min` gives their mean."""
    room, t = Room(), jnp.asarray(0.0)
    for height, value, slope in ((0.5, 0.5, 1.0), (2.75, 0.25, -1.0), (1.5, 1.5, 1.0)):
        state = jnp.array([height, 0.3])
        least, slopes = jax.value_and_grad(smallest_gap, 2)(room, t, state)
        assert float(least) == value
        assert np.array_equal(slopes, [slope, 0.0])


def test_normal_equations_do_not_depend_on_how_they_are_compiled(rooms, found):
    """To 1e-9 of the largest of each kind, at an optimum and away from it."""
    columns = free_columns(rooms, rooms.names)
    default = eqx.filter_jit(lambda *args: assemble_one.__wrapped__(*args))
    rng = np.random.default_rng(0)
    for away in (0.0, 0.01):
        states = found.point.states + away * rng.standard_normal(
            found.point.states.shape
        )
        every = rooms.pieces, rooms.extras, states, columns.local, columns.scales
        about = rooms.layout.about(found.point.values[0])
        args = about, *of_record(every, 0), False
        ours, theirs = (
            [np.asarray(leaf) for leaf in jax.tree.leaves(each(*args))]
            for each in (assemble_one, default)
        )
        for one, other in zip(ours, theirs):
            size = np.max(np.abs(other), initial=0.0)
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * size)


def test_a_linearisation_is_kept_for_the_same_point(rooms, found, monkeypatch):
    """Exactly for the same point, to 1e-12 in other units, and never for others."""
    columns = free_columns(rooms, rooms.names)
    local, calls = jnp.asarray(columns.local), []

    def counted(*args):
        calls.append(args)
        return _linearise_all(*args)

    monkeypatch.setattr(_linearise, "_linearise_all", counted)
    _linearise._LATEST.clear()

    def at(point, unit):
        scales = jnp.asarray(unit * columns.scales)
        given = rooms.layout, rooms.pieces, rooms.extras, point, local, scales
        return _linearise.assemble(*given)

    first, costs = at(found.point, 1.0)
    again, same = at(found.point._replace(states=found.point.states + 0.0), 1.0)
    assert len(calls) == 1
    assert all(map(np.array_equal, (*first, *costs), (*again, *same)))

    other, _ = at(found.point, 3.0)
    assert len(calls) == 1
    _linearise._LATEST.clear()
    direct, _ = at(found.point, 3.0)
    assert len(calls) == 2
    for one, two in zip(other, direct):
        size = np.max(np.abs(two))
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-12 * size)

    values = np.array(found.point.values)
    values[0, 0] *= 1 + 1e-15
    at(found.point._replace(values=jnp.asarray(values)), 1.0)
    assert len(calls) == 3


def test_a_fit_with_a_tolerance_ends_as_close_to_the_optimum(rooms, found):
    """In fewer iterations, at a cost that is higher by less than the tolerance."""
    start = {"gravity": 9.3, "drag": 0.5}
    ends = {
        tolerance: fit(
            rooms, start=start, tolerance=tolerance, stop=lambda costs: False
        )
        for tolerance in (1e3, 1e-8)
    }
    rough, fine = ends[1e3], ends[1e-8]
    assert rough.iterations < fine.iterations
    assert abs(fine.cost - found.cost) < 1e-3
    assert -1e-6 < rough.cost - fine.cost < 1e3


@pytest.mark.parametrize("tolerance", (0.0, -1.0, np.nan, np.inf))
def test_a_tolerance_is_positive(rooms, tolerance):
    with pytest.raises(ValueError, match="give a positive number"):
        fit(rooms, tolerance=tolerance)


@pytest.fixture(scope="module")
def shaken():
    """A position with an error of its sensor, whose size is a parameter."""

    def error(system, t, value, slope):
        return 1e-2 * system.drag * jnp.sin(30.0 * value) + 1e-4 * slope**2

    sensor = Sensor(0, noise=NOISE, gain=1.02, offset=3e-3, lag=2e-3, error=error)
    lagging = Parameter("lag", lambda m: m.sensors["height_m"].lag, scale=1e-3)
    calibrated = [
        Parameter("gain", lambda m: m.sensors["height_m"].gain, scale=0.1),
        Parameter("offset", lambda m: m.sensors["height_m"].offset, scale=0.01),
        lagging,
    ]
    rng = np.random.default_rng(5)
    run = record(TRUE, SENSORS, 2.0, rng=rng, state=[0.8, 0.3])
    model = Model(TRUE, {"height_m": sensor})
    parts = [segment(run, "height_m", 0.0)]
    return Problem.build(model, parts, [*PARAMETERS, *calibrated])


def test_only_the_error_of_a_sensor_is_seen_directly(shaken):
    """The gravity acts by the motion; gain, offset and lag are part of the
    calibration."""
    seen = dict(zip(shaken.names, seen_directly(shaken.layout, shaken.pieces)))
    assert [name for name, one in seen.items() if one] == ["drag"]


def test_a_model_without_parameters_has_states_that_are_fitted():
    """The cost is that of the noise."""
    rng = np.random.default_rng(7)
    parts = [
        segment(record(TRUE, SENSORS, 2.0, rng=rng, state=[0.8, 0.3]), "height_m", 0.0)
    ]
    problem = Problem.build(Model(TRUE, SENSORS), parts, [])
    found = fit(problem)
    assert abs(found.cost - problem.samples) < 5 * np.sqrt(2 * problem.samples)


def test_the_nodes_give_the_normal_equations_of_the_samples(shaken):
    """To 1e-12 of the largest of each kind, in units of the standard errors, with all
    parameters but that of the error free."""
    columns = free_columns(shaken, [n for n in shaken.names if n != "drag"])
    about, states = shaken.layout.about(shaken.start.values[0]), shaken.start.states
    every = shaken.pieces, shaken.extras, states, columns.local, columns.scales
    args = about, *of_record(every, 0)
    (fast, costs), (slow, expected) = (
        jax.tree.map(np.asarray, assemble_one(*args, direct))
        for direct in (False, True)
    )
    for one, other in zip(jax.tree.leaves(costs), jax.tree.leaves(expected)):
        np.testing.assert_allclose(one, other, rtol=1e-12)
    state = np.sqrt(np.diagonal(slow.ss, axis1=-2, axis2=-1))
    value = np.sqrt(np.diagonal(slow.pp))
    scales = {
        "ss": state[:, :, None] * state[:, None],
        "sp": state[:, :, None] * value,
        "s": state,
        "before": state[:, :, None] * np.roll(state, 1, axis=0)[:, None],
        "pp": value[:, None] * value,
        "p": value,
    }
    for name, scale in scales.items():
        unit = np.where(scale > 0, scale, 1.0)
        one, other = (getattr(blocks, name) / unit for blocks in (fast, slow))
        assert np.max(np.abs(one - other)) <= 1e-12 * np.max(np.abs(other)), name


def test_states_of_held_out_data_move_by_themselves(rooms, found, monkeypatch):
    """With steps three times too long, and one recording without weight.

    The full step makes the cost four times as large, so that it is shortened; the
    states of the other recording stay where they are.
    """
    every = rooms.everything()
    none = Weights(every.flown.copy(), every.rested.copy())
    none.flown[1], none.rested[1] = 0.0, 0.0
    moved = np.array(found.point.states)
    moved[:, :, 1] += 2e-4
    start = dataclasses.replace(
        found, point=found.point._replace(states=jnp.asarray(moved))
    )
    steps = _extended.state_steps
    monkeypatch.setattr(_extended, "state_steps", lambda *a: 3.0 * steps(*a))
    test = _extended.with_states(rooms, start, none, Policy())
    assert np.array_equal(test.point.states[1], moved[1])
    best = cost_by_recording(found.costs, none)
    assert best[1] == 0.0
    assert test.cost == pytest.approx(best[0], abs=0.1)


def test_what_has_no_weight_or_no_surface_costs_nothing():
    """Joints have the lesser weight of their pieces."""
    costs = Costs(
        np.array([[1.0, 2.0, np.nan]]),
        np.array([[10.0, 20.0, np.inf]]),
        np.array([[np.nan, 4.0]]),
    )
    weights = Weights(np.array([[1.0, 0.5, 0.0]]), np.ones((1, 2)))
    expected = 1.0 + 0.5 * 2.0 + 1.0 * 10.0 + 0.5 * 20.0 + 4.0
    assert cost_by_recording(costs, weights) == pytest.approx([expected])


def test_no_part_holds_out_sections_at_a_fixed_distance(rooms):
    """Else it could take all impacts of a periodic motion on one of two stops."""
    policy = Policy(folds=3, stretch_pieces=1)
    unseen = [out.flown for _, out in folds_of(rooms, policy)]
    for row in range(2):
        count = len(rooms.spans[row][0])
        parts = np.argmax([out[row, :count] for out in unseen], axis=0)
        rounds = parts[: 3 * (count // 3)].reshape(-1, 3)
        assert len(rounds) > 2
        assert any(tuple(one) != tuple(rounds[0]) for one in rounds)


def test_numbers_and_arrays_need_the_same_program(rooms):
    """A model made of Python numbers has the same types as one made of arrays."""
    room = Room(gravity=9.7, drag=0.12, restitution=0.75)
    weak = eqx.tree_at(lambda m: m.gravity, room, jnp.asarray(9.7))
    assert weak.gravity.weak_type
    kinds = []
    for one in (room, weak):
        problem = Problem.build(Model(one, SENSORS), rooms.segments, PARAMETERS)
        kinds.append([leaf.aval for leaf in jax.tree.leaves(problem.layout)])
    assert kinds[0] == kinds[1]
    assert not any(aval.weak_type for aval in kinds[0])
