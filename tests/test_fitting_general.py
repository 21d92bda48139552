"""Fits of systems other than a cam-follower, sensors, and what is refused."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from fitting_rigs import DraggedBall

from jaxcam import fitting
from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.evidence._held_out import folds_of
from jaxcam.fitting.engine import sound_information
from jaxcam.fitting.engine._columns import Columns
from jaxcam.fitting.engine._likelihood import score
from jaxcam.fitting.engine._linearise import Blocks, cost_of
from jaxcam.hybrid import HybridSystem
from jaxcam.models import BouncingBall, PowerLawRestitution
from jaxcam.recordings import mend, record, Recording, RecordingError, segment


NOISE = 1e-3
SENSORS = {"height_m": fitting.Sensor(0, noise=NOISE)}


def ball_record(system, seed, sensors=SENSORS, duration=2.0, name="drop"):
    rng = np.random.default_rng(seed)
    run = record(
        system,
        sensors,
        duration,
        rng=rng,
        state=jnp.array([1.0, 0.0]),
        interval=2e-3,
        name=name,
    )
    return segment(run, "height_m", np.zeros(len(run)), noise=NOISE, restitution=0.8)


PARAMETERS = [
    fitting.Parameter("gravity", lambda m: m.system.gravity, tolerance=0.5),
    fitting.Parameter("drag", lambda m: m.system.drag, lower=0.0, scale=0.1),
    fitting.Parameter(
        "restitution", lambda m: m.system.restitution, per_record=True, upper=1.0
    ),
]
TRUE = DraggedBall(gravity=9.7, drag=0.12, restitution=0.75)


@pytest.fixture(scope="module")
def balls():
    other = eqx.tree_at(lambda s: s.restitution, TRUE, 0.7)
    runs = [ball_record(TRUE, 0, name="a"), ball_record(other, 1, name="b")]
    model = fitting.Model(DraggedBall(), SENSORS)
    return fitting.Problem.build(model, runs, PARAMETERS)


def test_every_piece_is_held_out_once_and_every_part_holds_out_of_every_record(balls):
    """The parts of a test on held-out data: sections of each recording, at random."""
    parts = folds_of(balls, Policy(folds=3, stretch_pieces=2))
    every = balls.everything()
    for side in ("flown", "rested"):
        unseen = np.array([getattr(out, side) for _, out in parts])
        np.testing.assert_array_equal(unseen.sum(axis=0), getattr(every, side))
        for seen, out in parts:
            both = getattr(seen, side) + getattr(out, side)
            np.testing.assert_array_equal(both, getattr(every, side))
    flown = np.array([out.flown for _, out in parts])
    assert np.all(flown.sum(axis=2) > 0)


def test_a_readers_system_with_values_of_each_record(balls):
    found = fitting.fit(balls)
    assert found.converged
    truth = {"gravity": 9.7, "drag": 0.12, "restitution@a": 0.75, "restitution@b": 0.7}
    for name, value in truth.items():
        one = found[name]
        assert abs(one.value - value) < 3.3 * one.stderr, name
    assert float(found.model("b").system.restitution) == found["restitution@b"].value
    rms = [part.rms / part.noise for part in fitting.residuals(found)]
    assert np.max(np.abs(np.array(rms) - 1)) < 0.1


def test_short_flights_start_with_the_velocity_that_gravity_allows():
    """Few samples show no curvature; at the truth none is off by more than noise."""
    model = fitting.Model(TRUE, SENSORS)
    runs = [ball_record(TRUE, seed, name=str(seed)) for seed in range(4)]
    problem = fitting.Problem.build(model, runs, PARAMETERS)
    alone = eqx.tree_at(
        lambda p: p.joint, problem.pieces, jnp.zeros_like(problem.pieces.joint)
    )
    costs = cost_of(problem.layout, alone, problem.extras, problem.start)
    short = 0
    for row, (flown, _) in enumerate(problem.spans):
        for k, span in enumerate(flown):
            count = len(span.rows)
            if count < 24:
                short += 1
                assert costs.flown[row, k] < count + 5 * np.sqrt(2 * count)
    assert short > 0


def test_another_parameter_or_fewer_recordings_compile_nothing(balls):
    """The program that linearises a recording is traced for the first fit only."""
    traced = []

    def listen(event, duration, **about):
        if "trace_duration" in event and about.get("fun_name") == "assemble_one":
            traced.append(event)

    jax.clear_caches()
    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        fitting.fit(balls, free=["gravity"])
        assert len(traced) == 1
        fitting.fit(balls, free=["drag", "restitution"])
        few = fitting.Problem.build(balls.model, balls.segments[:-1], balls.parameters)
        fitting.fit(few, free=["gravity"], iterations=1)
    finally:
        jax.monitoring.unregister_event_duration_listener(listen)
    assert len(traced) == 1


def test_a_fit_that_is_stopped_says_so_and_keeps_what_it_has(balls):
    seen = []

    def stop(costs):
        seen.append(list(costs))
        return len(costs) > 2

    found = fitting.fit(balls, stop=stop)
    assert found.iterations == 2 and not found.converged
    assert "stopped after 2 iterations" in found.message
    # the start and one cost after each iteration, never rising
    assert [len(costs) for costs in seen] == [2, 3]
    assert found.cost == seen[-1][-1] <= seen[-1][1] <= seen[-1][0]


def test_the_optimum_is_that_of_optimistix(balls):
    """Against a dense Levenberg-Marquardt on one flight, all unknowns together."""
    import optimistix as optx

    run = ball_record(TRUE, 4)
    one = segment(run.recording.between(0.0, 0.4), "height_m", noise=NOISE)
    model = fitting.Model(DraggedBall(drag=0.12), SENSORS)
    problem = fitting.Problem.build(
        model, [one], [fitting.Parameter("gravity", lambda m: m.system.gravity)]
    )
    found = fitting.fit(problem)
    time, height = one.recording.time, one.recording["height_m"]

    def misfit(unknowns, _):
        g, h, v = unknowns
        c = 0.12
        # the solution of x'' = -g - c x'
        fall = (v + g / c) * (1 - jnp.exp(-c * time)) / c - g * time / c
        return (height - h - fall) / NOISE

    dense = optx.least_squares(
        misfit,
        optx.LevenbergMarquardt(rtol=1e-10, atol=1e-10),
        jnp.array([9.81, 1.0, 0.0]),
    )
    jacobian = jax.jacfwd(lambda u: misfit(u, None))(dense.value)
    stderr = np.sqrt(np.linalg.inv(jacobian.T @ jacobian)[0, 0])
    value = float(dense.value[0])
    assert found["gravity"].value == pytest.approx(value, abs=1e-3 * stderr)
    assert found["gravity"].stderr == pytest.approx(stderr, rel=1e-3)


@pytest.mark.parametrize(
    "sensor",
    [
        fitting.Sensor(0, noise=1.0),
        fitting.Sensor(0, noise=1.0, resolution=2.5),
        fitting.Sensor(0, noise=1.0, limit=2.0),
        fitting.Sensor(0, noise=1.0, tails=4.0),
    ],
)
def test_likelihoods(sensor):
    """Scores are derivatives, zero on average; their square is the information."""
    rng = np.random.default_rng(0)
    truth = 1.3
    values = truth + rng.standard_normal(200_000)
    if sensor.tails < np.inf:
        values = truth + rng.standard_t(4.0, 200_000)
    if sensor.resolution:
        values = np.round(values / sensor.resolution) * sensor.resolution
    values = jnp.clip(jnp.asarray(values), -sensor.limit, sensor.limit)
    at = jnp.full_like(values, truth)
    h = 1e-5
    found = score(sensor, values, at)
    ends = [score(sensor, values, at + s * h).cost for s in (1, -1)]
    np.testing.assert_allclose(
        -(ends[0] - ends[1]) / (4 * h), found.score, rtol=1e-6, atol=1e-8
    )
    spread = float(jnp.std(found.score))
    assert abs(float(jnp.mean(found.score))) < 4 * spread / np.sqrt(len(values))
    if sensor.tails == np.inf:
        mean = float(jnp.mean(found.information))
        # rounding to 2.5 standard deviations loses more than its variance tells
        assert mean == pytest.approx(spread**2, rel=0.2)


@pytest.mark.slow
def test_saturated_and_filtered_rate():
    """A gyro with a bandwidth and a range that the motion exceeds."""
    sensors = {
        "height_m": fitting.Sensor(0, noise=NOISE),
        "speed_m_s": fitting.Sensor(1, noise=0.02, bandwidth_hz=20.0, limit=2.5),
    }
    part = ball_record(TRUE, 7, sensors)
    assert np.mean(np.abs(part.recording["speed_m_s"]) == 2.5) > 0.02
    named = Recording(
        "drop", part.recording.time, {"speed_rad_s": part.recording["speed_m_s"]}
    )
    assert any("saturated" in note for note in mend(named).notes)
    problem = fitting.Problem.build(
        fitting.Model(DraggedBall(), sensors), [part], PARAMETERS
    )
    found = fitting.fit(problem)
    for name, value in {"gravity": 9.7, "drag": 0.12, "restitution": 0.75}.items():
        one = found[name]
        assert abs(one.value - value) < 3.3 * one.stderr, name


def test_lag_gain_and_offset_of_a_sensor():
    true = fitting.Sensor(0, noise=NOISE, gain=1.02, offset=0.01, lag=1e-3)
    part = ball_record(TRUE, 8, {"height_m": true})
    # a floor that the sensor shows elsewhere is no floor to cut at
    time = part.recording.time
    flight = segment(part.recording.between(0.46, 1.1), "height_m", noise=NOISE)
    assert time[0] == 0
    model = fitting.Model(TRUE, SENSORS)
    gain = fitting.Parameter("gain", lambda m: m.sensors["height_m"].gain)
    problem = fitting.Problem.build(model, [flight], [gain])
    found = fitting.fit(problem)["gain"]
    # gravity is known, so the curvature shows the gain
    assert abs(found.value - 1.02) < 3.3 * found.stderr


@pytest.mark.slow
def test_network_in_the_vector_field():
    """A force that nobody stated, learnt by gradients in reverse mode."""

    class Learnt(HybridSystem):
        state_names = ("height", "velocity")

        network: eqx.nn.MLP
        restitution: float = 0.75

        def vector_field(self, t, state):
            push = self.network(state[1:] / 4)[0]
            return jnp.stack([state[1], -9.7 + push])

        def gap(self, t, state):
            return state[0]

        def impact(self, t, state):
            return jnp.stack([state[0], -self.restitution * state[1]])

    net = eqx.nn.MLP(1, 1, 8, 1, jnp.tanh, key=jax.random.key(0))
    # at first no force at all
    net = eqx.tree_at(lambda n: n.layers[-1].weight, net, 0 * net.layers[-1].weight)
    net = eqx.tree_at(lambda n: n.layers[-1].bias, net, 0 * net.layers[-1].bias)
    strong = eqx.tree_at(lambda s: s.drag, TRUE, 0.5)
    part = ball_record(strong, 9, duration=1.5)
    problem = fitting.Problem.build(fitting.Model(Learnt(net), SENSORS), [part], [])
    trained, before, after = fitting.train(
        problem, lambda m: m.system.network, steps=60
    )
    # -0.5 v over the speeds of the flights
    assert after < 0.2 * before
    for speed in (-3.0, 2.0):
        force = float(trained(jnp.array([speed / 4]))[0])
        assert force == pytest.approx(-0.5 * speed, abs=0.3)


def test_restitution_from_every_impact():
    part = ball_record(BouncingBall(restitution=0.7), 2)
    laws = fitting.restitution_laws([part])
    constant = laws["constant"]
    assert abs(constant.values[0] - 0.7) < 3.3 * constant.stderr[0]
    assert abs(laws["approach"].values[1]) < 3.3 * laws["approach"].stderr[1]
    assert "speed" not in laws
    start = PowerLawRestitution(0.5, 1.0, 0.0)
    again = fitting.fit_restitution([part], start, ("r0",))
    assert again.values[0] == pytest.approx(constant.values[0], rel=1e-6)


@pytest.mark.parametrize(
    ("direction", "words"),
    [
        ([0.6, 0.8], "only their ratio matters"),
        ([0.6, -0.8], "only their product matters"),
        ([0.8, 0.6], "increasing K and J together; the"),
    ],
)
def test_a_pair_that_is_seen_only_together(direction, words):
    """K = 100 in units of 3, J = 2 in units of 0.045: 0.6 and 0.8 are equal parts."""
    d = np.array(direction)
    report = fitting.Identifiability(
        ("K", "J"),
        np.stack([[d[1], -d[0]], d]),
        np.array([0.01, 50.0]),
        values=np.array([100.0, 2.0]),
        scales=np.array([3.0, 0.045]),
        alone=np.array([0.01, 0.01]),
        together=np.array([30.0, 40.0]),
    )
    sentences = report.sentences()
    assert sentences[0].startswith("The data determine 1 of 2")
    assert words in sentences[1]


def test_a_recording_whose_information_is_lost_to_rounding_is_not_counted():
    """One state and one parameter: the information pp - sp^2 / ss is 1 in the first
    recording, and -0.001, which no data have, in the second."""
    ones = jnp.ones((2, 1, 1, 1))
    pp = jnp.array([2.0, 0.999])[:, None, None]
    blocks = Blocks(ones, ones, ones[..., 0], 0 * ones, pp, ones[:, 0, 0])
    indices = np.zeros((2, 1), dtype=int)
    columns = Columns(indices[0], indices[0] - 1, indices, indices, np.ones(1))
    information, lost = sound_information(columns, blocks)
    np.testing.assert_allclose(information, [[1.0]], rtol=1e-12)
    assert lost.tolist() == [1]
    report = fitting.Identifiability(
        ("K",), np.ones((1, 1)), *np.ones((5, 1)), lost=("second",)
    ).sentences()
    assert "the motion in second is so sensitive" in report[1]


def test_refusals(balls):
    with pytest.raises(ValueError, match="no parameter 'mass'"):
        fitting.fit(balls, free=["mass"])
    model = fitting.Model(DraggedBall(), SENSORS)
    same = fitting.Parameter("g", lambda m: m.system.gravity)
    with pytest.raises(ValueError, match="same number"):
        fitting.Problem.build(model, balls.segments, [*PARAMETERS, same])
    whole = fitting.Parameter("all", lambda m: m.system)
    with pytest.raises(ValueError, match="not a single number"):
        fitting.Problem.build(model, balls.segments, [whole])
    with pytest.raises(ValueError, match="positive"):
        fitting.Parameter("g", lambda m: m.system.gravity, tolerance=0.0)
    with pytest.raises(RecordingError, match="no recording"):
        fitting.Problem.build(model, [], [])
    with pytest.raises(RecordingError, match="no channel `width_m`"):
        sensors = {"width_m": fitting.Sensor(0, noise=1.0)}
        fitting.Problem.build(fitting.Model(DraggedBall(), sensors), balls.segments, [])
