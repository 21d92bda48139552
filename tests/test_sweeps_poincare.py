"""Points on Poincaré sections of many motions at once."""

import jax.numpy as jnp
import numpy as np
import pytest
from textbook_systems import parameters, TwoMasses, TwoStops

import jaxcam
from jaxcam.hybrid import Settings
from jaxcam.models import (
    BeltOscillator,
    BouncingBall,
    ImpactOscillator,
    ReliefValve,
    SpinningBall,
)
from jaxcam.sweeps import PoincareSection


OSCILLATOR = ImpactOscillator(omega=2.6, restitution=0.8, wall=0.0)
_SECTIONS = {
    # a valve that hits its seat, one at rest, one that oscillates
    "valve": (
        ReliefValve(),
        lambda t, x: x[1],
        [[0.2, 0.0, 10.0], [0.5, 0.3, 9.0], [1.5, -1.0, 12.0]],
        8.0,
    ),
    # impacts carry the velocity across the section
    "oscillator": (OSCILLATOR, lambda t, x: x[1], [[-0.5, 1.0], [-1.0, 0.2]], 9.0),
    # with the time
    "in time": (
        OSCILLATOR,
        lambda t, x: x[0] + 0.3 + 0.1 * jnp.sin(t),
        [[-0.5, 1.0], [-1.0, 0.2]],
        9.0,
    ),
    # that rests upon its wall between two flights
    "ball": (
        BouncingBall(amplitude=0.0112, frequency=31.0, restitution=0.3),
        lambda t, x: x[1],
        [[0.03, 0.0], [0.1, 0.2]],
        0.6,
    ),
    # sticks to a belt
    "belt": (BeltOscillator(), lambda t, x: x[0], [[1.0, 0.0], [-0.3, 0.5]], 9.0),
    # slides and sticks in a contact
    "spinning ball": (
        SpinningBall(),
        lambda t, x: x[2] - 0.8,
        [[0.0, 0.0, 1.0, 0.0, 0.0], [0.0, 0.05, 1.0, 0.0, 3.0]],
        2.0,
    ),
}


@pytest.mark.parametrize("direction", [1, -1, 0])
@pytest.mark.parametrize("name", _SECTIONS)
def test_a_batch_of_sections_is_that_of_trajectories(name, direction):
    """Times and states of the last points to 1e-8, impacts and contacts that begin
    between them; the trajectory locates them by bisection.
    """
    system, function, states, length = _SECTIONS[name]
    keep = 5
    section = PoincareSection(system, function, direction, period=length)
    samples = section.sample(states, 1, keep)
    found = 0
    for k, state in enumerate(states):
        run = jaxcam.simulate(system, state, 0.0, length)
        times, points = map(np.asarray, run.section(function, direction))
        number = min(keep, len(times))
        found += number
        assert np.isfinite(samples.times[k]).sum() == number
        if not number:
            continue
        assert np.abs(samples.times[k, -number:] - times[-number:]).max() < 1e-8
        assert np.abs(samples.states[k, -number:] - points[-number:]).max() < 1e-8
        edges = np.concatenate([[0.0], times])
        hits = np.histogram(np.asarray(run.impacts.time), edges)[0][-number:]
        assert np.array_equal(samples.hits[k, -number:], hits)
        begun = np.asarray(run.contacts.start)
        rests = np.histogram(begun[begun > 0], edges)[0][-number:]
        assert np.array_equal(samples.rests[k, -number:], rests)
        assert np.abs(samples.final[k] - np.asarray(run.final)).max() < 1e-8
    assert found > 0 or (name, direction) == ("spinning ball", 1)


def test_a_motion_at_rest_does_not_cross_a_section_without_end():
    """Oscillations of the valve decay; at rest, rounding moves it to and fro."""
    valve = ReliefValve(flow=9.6)
    section = PoincareSection(valve, lambda t, x: x[1], -1, period=600.0)
    samples = section.sample([[0.2, 0.0, 10.0]], 1, 4)
    assert samples.code.tolist() == [0]
    lift = samples.final[0, 0]
    pressure = 10.0 + lift
    assert abs(lift * np.sqrt(pressure) - 9.6) < 1e-8


def test_a_direction_is_one_of_three():
    with pytest.raises(ValueError, match="direction is 2"):
        PoincareSection(OSCILLATOR, lambda t, x: x[1], 2).sample([[-0.5, 1.0]], 2, 1)


_P = parameters(
    omega=1.7, stop=0.3, restitution=0.4, force=1.0, stiffness=1.0, damping=0.05
)
_RESTING = {
    # on its wall, again and again
    "wall": (ImpactOscillator(0.5, 0.5, 0.2, 0.05), [-0.1, 0.2], 1, 50.0),
    # starts on its seat
    "seat": (ReliefValve(), [0.0, 0.0, 5.0], 1, 8.0),
    "one of two masses": (TwoMasses(**_P), [-0.1, 0.1, 0.2, -0.3], 2, 15.0),
    "both masses": (TwoStops(**_P), [-0.1, 0.1, 0.2, -0.3], 2, 15.0),
}


@pytest.mark.parametrize("name", _RESTING)
def test_rest_on_a_section_is_no_crossing(name):
    """The velocity of a body at rest on a fixed constraint is zero. Points where it is
    in flight: those of the trajectory, to 1e-8.
    """
    system, state, k, length = _RESTING[name]
    section = PoincareSection(system, lambda t, x: x[k], 0, period=length)
    samples = section.sample([state], 1, 200)
    assert samples.code.tolist() == [0]
    run = jaxcam.simulate(system, state, 0.0, length)
    times = np.asarray(run.section(lambda t, x: x[k], 0)[0])
    ends = np.concatenate([run.contacts.start, run.contacts.end, [0.0]])
    ends = ends[np.isfinite(ends)]
    flying = [np.min(np.abs(t - ends)) > 1e-6 for t in times]
    found = samples.times[0][np.isfinite(samples.times[0])]
    ours = [np.min(np.abs(t - ends)) > 1e-6 for t in found]
    assert np.abs(found[ours] - times[flying]).max() < 1e-8


@pytest.mark.parametrize("backend", ["llvm", "xla"])
def test_either_backend_samples_a_section(backend):
    samples = PoincareSection(
        OSCILLATOR, lambda t, x: x[1], -1, settings=Settings(backend=backend)
    ).sample([[-0.5, 1.0]], 4, 3)
    run = jaxcam.simulate(OSCILLATOR, [-0.5, 1.0], 0.0, 4 * float(OSCILLATOR.period))
    times = np.asarray(run.section(lambda t, x: x[1], -1)[0])
    assert np.isnan(samples.times[0, :2]).all() and len(times) == 1
    assert abs(samples.times[0, 2] - times[0]) < 1e-8


def test_what_a_section_refuses():
    start, of = [[-0.5, 1.0]], lambda t, x: x[1]
    with pytest.raises(ValueError, match="restitution"):
        PoincareSection(ImpactOscillator(restitution=1.4), of).sample(start, 2, 1)
    with pytest.raises(ValueError, match="returns shape"):
        PoincareSection(OSCILLATOR, lambda t, x: x).sample(start, 2, 1)
    with pytest.raises(ValueError, match="no forcing period"):
        PoincareSection(ReliefValve(), of).sample([[0.2, 0.0, 10.0]], 2, 1)


def test_a_parameter_of_a_section_by_its_name():
    section = PoincareSection(OSCILLATOR, lambda t, x: x[1])
    one, two = (
        section.sample([[-0.5, 1.0]] * 2, 3, 2, where=w, values=[2.6, 2.7])
        for w in ("omega", lambda s: s.omega)
    )
    assert np.array_equal(one.times, two.times)
