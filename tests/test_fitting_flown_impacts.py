"""Impacts that the model finds in motions that bend as much as an impact bends them."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxcam.fitting import (
    fit,
    Model,
    Parameter,
    Problem,
    restitution_laws,
    segment_by_model,
    Sensor,
)
from jaxcam.fitting.own_systems import Field
from jaxcam.hybrid import HybridSystem
from jaxcam.recordings import Recording
from jaxcam.recordings.cut import hides_kinks, oscillation_period


NOISE = 4e-6
RESTITUTION = 0.58


class Harvester(HybridSystem):
    """A magnet on a spring between two stops, on a base that a shaker accelerates."""

    state_names = ("displacement", "velocity")

    stiffness: float = 98000.0
    damping: float = 14.0
    amplitude: float = 36.0
    frequency: float = 45.0
    right: float = 1.1e-3
    left: float = -0.9e-3
    restitution: float = 0.5

    def vector_field(self, t, state):
        x, v = state
        base = self.amplitude * jnp.cos(2 * jnp.pi * self.frequency * t)
        return jnp.stack([v, -self.stiffness * x - self.damping * v - base])

    def gap(self, t, state):
        return jnp.stack([self.right - state[0], state[0] - self.left])

    def impact(self, t, state):
        hit = jnp.stack([state[0], -self.restitution * state[1]])
        return jnp.stack([hit, hit])


class Coil(HybridSystem):
    """The same with a voltage that the motion drives, but that does not act on it."""

    state_names = ("displacement", "velocity", "voltage")

    mechanics: Harvester = Harvester()

    def vector_field(self, t, state):
        motion = self.mechanics.vector_field(t, state[:2])
        return jnp.append(motion, 2.0 * state[1] - 300.0 * state[2])

    def gap(self, t, state):
        return self.mechanics.gap(t, state[:2])

    def impact(self, t, state):
        after = self.mechanics.impact(t, state[:2])
        return jnp.concatenate([after, jnp.full((2, 1), state[2])], axis=1)


TRUTH = {"stiffness": 101000.0, "damping": 12.0, "amplitude": 35.0}
MODEL = Model(Harvester(), {"displacement_m": Sensor(0, noise=NOISE)})
FREE = (
    Parameter("stiffness", Field("system.stiffness"), 4000.0),
    Parameter("damping", Field("system.damping"), 8.0, lower=0.0),
    Parameter("amplitude", Field("system.amplitude"), 3.0),
    Parameter("right", Field("system.right"), 5e-5),
    Parameter("left", Field("system.left"), 5e-5),
    Parameter("restitution", Field("system.restitution"), 0.15),
)


def _moved(rate: float, amplitude: float = 35.0, seconds: float = 0.6):
    """Return the times, positions and impacts of the true rig, from SciPy alone."""
    omega, walls = 2 * np.pi * 45.0, (1.12e-3, -0.88e-3)

    def field(t, x):
        base = amplitude * np.cos(omega * t)
        pull = TRUTH["stiffness"] * x[0] + TRUTH["damping"] * x[1]
        return [x[1], -pull - base]

    def closed(wall, sign):
        def gap(t, x):
            return sign * (wall - x[0])

        gap.terminal, gap.direction = True, -1
        return gap

    events = [closed(walls[0], 1.0), closed(walls[1], -1.0)]
    times = np.arange(round(seconds * rate)) / rate
    begin, state, hits = -0.2, [0.0, 0.0], []
    positions = np.zeros(len(times))
    while begin < times[-1]:
        found = solve_ivp(
            field,
            (begin, times[-1] + 1e-9),
            state,
            method="DOP853",
            rtol=1e-10,
            atol=1e-13,
            events=events,
            dense_output=True,
            max_step=1e-3,
        )
        rows = (times >= begin) & (times <= found.t[-1])
        if np.any(rows):
            positions[rows] = found.sol(times[rows])[0]
        begin = found.t[-1]
        if found.status == 1:
            side = 0 if len(found.t_events[0]) else 1
            hits.append((begin, side))
            # an event must not be found again where the flight begins
            place = walls[side] + (1e-13 if side else -1e-13)
            state = [place, -RESTITUTION * found.y[1, -1]]
    return times, positions, [one for one in hits if 0 < one[0] < times[-1]]


def _recorded(times, positions, seed: int = 0) -> Recording:
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(times))
    return Recording("run", times, {"displacement_m": positions + noise})


@pytest.fixture(scope="module")
def coarse():
    """A recording with 44 samples per period, an impact every other period, and a
    motion that turns round a tenth of a millimetre before the other stop.
    """
    times, positions, hits = _moved(2000.0)
    (part,) = segment_by_model(MODEL, [_recorded(times, positions)], FREE)
    return part, hits


def test_every_impact_is_found_and_none_is_invented(coarse):
    """Kinks alone show 26 impacts here. The times follow from flights that are known to
    a hundredth of a sampling interval.
    """
    part, hits = coarse
    assert len(hits) == 13
    assert part.impacts.count == len(hits)
    when, sides = np.array(hits).T
    assert np.max(np.abs(part.impacts.time - when)) < 0.1 * part.recording.interval
    assert part.impacts.side.tolist() == sides.tolist()
    assert not part.contacts


def test_single_impacts_show_the_restitution_within_their_errors(coarse):
    """The mean square of 13 deviations in standard errors is below 2.6 with a
    probability of 99.8 per cent.
    """
    impacts = coarse[0].impacts
    off = (impacts.restitution - RESTITUTION) / impacts.restitution_stderr
    assert np.mean(off**2) < 2.6


def test_impacts_of_one_speed_show_no_law_of_the_speed(coarse):
    """A power law fitted to them would be extrapolated to any value at rest."""
    part, _ = coarse
    assert np.ptp(part.impacts.approach) < 0.1 * np.mean(part.impacts.approach)
    assert list(restitution_laws([part])) == ["constant"]


def test_a_state_that_no_channel_shows_changes_nothing(coarse):
    """The same impacts, to a thousandth of a sampling interval."""
    part, _ = coarse
    free = [
        Parameter(one.name, Field(f"system.mechanics.{one.name}"), one.tolerance)
        for one in FREE
    ]
    model = Model(Coil(), MODEL.sensors)
    (other,) = segment_by_model(model, [part.recording], free)
    off = other.impacts.time - part.impacts.time
    assert np.max(np.abs(off)) < 1e-3 * part.recording.interval


def test_a_fit_recovers_the_parameters(coarse):
    """Six values within 3.5 standard errors: by chance, one fit in 400 fails."""
    found = fit(Problem.build(MODEL, [coarse[0]], FREE))
    assert found.converged
    truth = {**TRUTH, "right": 1.12e-3, "left": -0.88e-3, "restitution": RESTITUTION}
    for one in found.estimates:
        assert abs(one.value - truth[one.name]) < 3.5 * one.stderr, one.name


def test_a_motion_without_impacts_is_one_flight():
    times, positions, hits = _moved(2000.0, amplitude=12.0)
    assert not len(hits)
    (part,) = segment_by_model(MODEL, [_recorded(times, positions)], FREE)
    assert part.impacts.count == 0
    assert len(part.flights) == 1


def test_too_few_samples_are_noted_with_the_rate_that_suffices():
    """The motion repeats after two periods of 22 ms; at 400 samples per second, it has
    about nine samples per oscillation."""
    times, positions, _ = _moved(400.0)
    run = _recorded(times, positions)
    (part,) = segment_by_model(MODEL, [run], FREE)
    (note,) = part.recording.meta["notes"]
    assert "samples per oscillation" in note
    rate = float(note.rpartition("record at ")[2].split()[0])
    assert 1200 < rate < 1500
    assert "notes" not in run.meta


def test_enough_samples_are_not_noted(coarse):
    assert "notes" not in coarse[0].recording.meta


def test_the_period_of_a_noisy_sine():
    """With 20 samples per period, to half a per cent."""
    time = np.arange(2000) * 5e-4
    noise = 0.01 * np.random.default_rng(0).standard_normal(len(time))
    period = oscillation_period(np.sin(2 * np.pi * time / 0.01) + noise, 5e-4)
    assert abs(period - 0.01) < 5e-5


def test_a_slow_motion_does_not_need_the_model():
    """The windows of a kink are ten milliseconds long."""
    assert hides_kinks(0.02, 5e-4)
    assert hides_kinks(0.02, 1e-4)
    assert not hides_kinks(0.2, 1e-3)
    # with few samples per second, the windows are longer
    assert hides_kinks(0.2, 1e-2)


def test_constants_of_a_recording_count_and_filtered_channels_do_not():
    """The frequency of the recording is not that of the class; the samples of a
    channel with a filter, which are zero here, do not show the motion directly.
    """
    filtered = Sensor(1, noise=1e-3, bandwidth_hz=300.0)
    other = Model(
        dataclasses.replace(MODEL.system, frequency=jnp.asarray(50.0)),
        {**MODEL.sensors, "velocity_m_s": filtered},
    )
    times, positions, hits = _moved(2000.0, seconds=0.3)
    run = _recorded(times, positions)
    channels = {**run.channels, "velocity_m_s": np.zeros(len(times))}
    run = dataclasses.replace(run, channels=channels, constants={"frequency": 45.0})
    (part,) = segment_by_model(other, [run], FREE)
    assert part.impacts.count == len(hits)
