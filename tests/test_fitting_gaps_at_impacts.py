"""A ball on a shaken table whose phase is unknown: the impacts determine it."""

import dataclasses
import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcam
from jaxcam.fitting import Model, Parameter, segment_by_model, Sensor
from jaxcam.fitting._gaps_at_impacts import fitted_to_impacts, gap_points, GapPoints
from jaxcam.fitting._measured_gaps import measured_gaps
from jaxcam.hybrid import HybridSystem
from jaxcam.recordings import Recording


NOISE = 2e-5
# frequency (rad/s), phase (rad): one that rests on the table, and a bouncing one
RUNS = ((60.0, 0.05), (75.0, -1.5632))


def _number(value) -> jax.Array:
    return eqx.field(converter=jnp.asarray, default=value)


class Shaken(HybridSystem):
    """Height and velocity of a ball above a table that moves up and down."""

    state_names = ("height", "velocity")
    amplitude: jax.Array = _number(0.004)
    omega: jax.Array = _number(60.0)
    phase: jax.Array = _number(0.0)
    restitution: jax.Array = _number(0.63)

    def vector_field(self, t, state):
        return jnp.stack([state[1], -9.81])

    def gap(self, t, state):
        return state[0] - self.amplitude * jnp.sin(self.omega * t + self.phase)

    def impact(self, t, state):
        rate = self.amplitude * self.omega * jnp.cos(self.omega * t + self.phase)
        return jnp.stack([state[0], rate - self.restitution * (state[1] - rate)])


PARAMETERS = (
    Parameter("amplitude", lambda m: m.system.amplitude, tolerance=2e-4),
    Parameter("phase", lambda m: m.system.phase, tolerance=3.2, per_record=True),
)


@functools.cache
def measured(omega, phase):
    table = Shaken(omega=omega, phase=phase, amplitude=0.00408)
    run = jaxcam.simulate(table, [0.03, 0.0], 0.0, 2.0)
    time = np.arange(0.0, 2.0, 5e-4)
    rng = np.random.default_rng(3)
    height = np.asarray(run.at(time))[:, 0] + NOISE * rng.standard_normal(len(time))
    return run, Recording(f"{omega:g}", time, {"height_m": height})


def gaps_of(run: Recording, omega, points: GapPoints):
    """Gap at each impact, and its derivatives by amplitude and phase."""
    height = np.interp(points.time, run.time, run["height_m"])

    def found(values):
        angle = omega * points.time + values[1]
        slopes = [-np.sin(angle), -values[0] * np.cos(angle)]
        return height - values[0] * np.sin(angle), np.stack(slopes, axis=-1)

    return found


@pytest.mark.parametrize(("omega", "phase"), RUNS)
def test_impacts_determine_the_phase(omega, phase):
    """To 0.02 rad and 1 % of the amplitude, and to four standard deviations."""
    _, run = measured(omega, phase)
    gap = run["height_m"] - 0.004 * np.sin(omega * run.time)
    points = gap_points(run.time, gap[None], np.array([0.013]), run.interval)
    at = gaps_of(run, omega, points)
    found = fitted_to_impacts(points, at, PARAMETERS, np.array([0.004, 0.0]))
    assert found is not None
    off = found.values - [0.00408, phase]
    assert np.all(np.abs(off) < [4e-5, 0.02])
    assert np.all(np.abs(off) < 4 * np.sqrt(np.diag(found.covariance)))


def test_impacts_elsewhere_determine_nothing():
    """Heights that no phase explains."""
    rng = np.random.default_rng(5)
    time = np.sort(rng.uniform(0.0, 2.0, 30))
    run = Recording("none", time, {"height_m": rng.uniform(-0.004, 0.004, 30)})
    nominal = np.array([0.004, 0.0])
    off = run["height_m"] - 0.004 * np.sin(60.0 * time)
    points = GapPoints(time, np.zeros(30, int), off, np.full(30, NOISE))
    at = gaps_of(run, 60.0, points)
    assert fitted_to_impacts(points, at, PARAMETERS, nominal) is None


def test_values_far_outside_their_tolerances_are_refused():
    """Half the amplitude, known to 5 %."""
    omega, phase = RUNS[1]
    _, run = measured(omega, phase)
    nominal = np.array([0.002, phase])
    gap = run["height_m"] - 0.002 * np.sin(omega * run.time + phase)
    points = gap_points(run.time, gap[None], np.array([0.01]), run.interval)
    at = gaps_of(run, omega, points)
    for tolerance, determined in ((1e-4, False), (2e-3, True)):
        known = dataclasses.replace(PARAMETERS[0], tolerance=tolerance), PARAMETERS[1]
        found = fitted_to_impacts(points, at, known, nominal)
        assert (found is not None) == determined


def test_values_that_the_impacts_do_not_determine_are_refused():
    """The sum of two offsets of the table, both unknown."""
    omega, phase = RUNS[1]
    _, run = measured(omega, phase)
    gap = run["height_m"] - 0.00408 * np.sin(omega * run.time + phase)
    points = gap_points(run.time, gap[None], np.array([0.01]), run.interval)

    def at(values):
        here = np.interp(points.time, run.time, gap) - values[0] - values[1]
        return here, np.full((len(points.time), 2), -1.0)

    unknown = [Parameter(name, lambda m: m.system.phase) for name in ("a", "b")]
    assert fitted_to_impacts(points, at, unknown, np.zeros(2)) is None
    known = dataclasses.replace(unknown[0], tolerance=1.0)
    assert fitted_to_impacts(points, at, (known, unknown[1]), np.zeros(2)) is not None


def test_values_respect_bounds_and_stated_nominal_values():
    """An unknown amplitude is positive, and the phase is near its nominal value, which
    is not that of the model.
    """
    omega, phase = RUNS[1]
    _, run = measured(omega, phase)
    gap = run["height_m"] - 0.004 * np.sin(omega * run.time)
    points = gap_points(run.time, gap[None], np.array([0.013]), run.interval)
    amplitude = Parameter("amplitude", lambda m: m.system.amplitude, lower=0.0)
    near = dataclasses.replace(PARAMETERS[1], nominal=phase + 0.1, tolerance=0.2)
    at = gaps_of(run, omega, points)
    found = fitted_to_impacts(points, at, (amplitude, near), np.array([0.004, 0.0]))
    assert found is not None
    assert np.all(np.abs(found.values - [0.00408, phase]) < [4e-5, 0.02])


@pytest.mark.parametrize(("omega", "phase"), RUNS)
def test_impacts_and_rests_are_found(omega, phase):
    """With the phase 0 in the model, all impacts faster than 0.15 m/s are found at
    their times, to two sampling intervals, and so are rests of more than 10 ms.
    """
    truth, run = measured(omega, phase)
    model = Model(Shaken(omega=omega), {"height_m": Sensor(0, noise=NOISE)})
    (part,) = segment_by_model(model, [run], PARAMETERS)
    count = int(truth.impacts.count)
    time = np.asarray(truth.impacts.time)[:count]
    angle = omega * time + phase
    rate = 0.00408 * omega * np.cos(angle)
    fast = rate - np.asarray(truth.impacts.before)[:count, 1] > 0.15
    starts = np.array([one.start.time for one in part.contacts])
    seen = np.append(part.impacts.time, starts)
    apart = np.min(np.abs(seen[None] - time[fast][:, None]), axis=1)
    assert np.all(apart < 2 * run.interval)
    for k in range(int(truth.contacts.count)):
        start, stop = (float(x[k]) for x in (truth.contacts.start, truth.contacts.end))
        assert stop < start + 0.01 or any(
            one.first * run.interval < start < stop < one.last * run.interval + 1e-3
            for one in part.contacts
        )


class Box(Shaken):
    """A ball between the table and a lid at rest, which it does not reach."""

    lid: jax.Array = _number(0.2)

    def gap(self, t, state):
        return jnp.stack([super().gap(t, state), self.lid - state[0]])

    def impact(self, t, state):
        down = jnp.stack([state[0], -self.restitution * state[1]])
        return jnp.stack([super().impact(t, state), down])


def test_a_gap_that_no_impact_shows_keeps_its_error():
    """The lid is known to 2 mm; the table, after the fit, to 0.1 mm."""
    _, run = measured(*RUNS[1])
    model = Model(Box(omega=RUNS[1][0]), {"height_m": Sensor(0, noise=NOISE)})
    lid = Parameter("lid", lambda m: m.system.lid, tolerance=2e-3)
    states = np.stack([run["height_m"], np.zeros(len(run))], axis=1)
    picks = {0: "height_m"}
    gaps, _, errors, _, _ = measured_gaps(
        model, (*PARAMETERS, lid), run, states, None, picks
    )
    assert gaps.shape == (2, len(run))
    assert errors[0] < 1e-4 and errors[1] == pytest.approx(2e-3)
