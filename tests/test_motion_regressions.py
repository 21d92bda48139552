"""Runs that once went wrong, each with what was wrong."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import monitoring

import jaxcam
from jaxcam.hybrid import HybridSystem, stroboscope
from jaxcam.hybrid.lowering._scalarise import scalarise, split
from jaxcam.hybrid.surface import contact_state
from jaxcam.models import (
    BouncingBall,
    CamFollower,
    ImpactOscillator,
    preset,
    rpm_to_rad_s,
)


def test_release_point_start_reaches_the_end():
    # the first step after a release once ran out of attempts
    system = CamFollower(speed=rpm_to_rad_s(155.0))
    trajectory = jaxcam.simulate(system, None, 0.0, 12.0)
    assert trajectory.successful, trajectory.result


def test_hops_as_low_as_rounding_do_not_hold_up_a_batch():
    # near its release at 150.82 rpm a lane once spent a thousand attempts on one hop
    speeds = np.linspace(130.0, 160.0, 256)[[100, 175, 177]]
    system = CamFollower()
    start = np.array([float(system.contact_angle(0.0)) + 0.02, 0.0])
    made = stroboscope(
        system,
        start,
        70,
        where=lambda s: s.speed,
        values=rpm_to_rad_s(speeds),
    )
    assert np.all(made.code == 0)
    assert np.all(made.steps <= 3 * made.impacts + 12 * 70)


def test_landing_is_not_mistaken_far_from_the_surface():
    # the series for the landing time vanishes by accident far below the table
    hexadecimal = (
        "0x1.433e76f6c78f6p+3",
        "0x1.7327c839adcf5p-3",
        "0x1.86c55c905a6ebp-5",
        "0x1.8d8e11facc012p+4",
    )
    gravity, restitution, amplitude, frequency = map(float.fromhex, hexadecimal)
    system = BouncingBall(
        gravity=gravity,
        restitution=restitution,
        amplitude=amplitude,
        frequency=frequency,
    )
    start = jnp.array([0.54248909, -1.02249612])
    trajectory = jaxcam.simulate(system, start, 0.3, 3.0, tolerance=1e-6)
    assert trajectory.successful, trajectory.result
    assert float(trajectory.gap(np.linspace(0.3, 3.0, 2000)).min()) > -1e-9


def test_stroboscope_starts_at_any_time():
    # 0.1 + turns 0.7 is rounded differently with and without a fused product
    starts = np.stack([np.linspace(-0.9, -0.1, 8), np.zeros(8)], axis=1)
    made = stroboscope(ImpactOscillator(), starts, 5, t0=0.1, period=0.7)
    assert np.all(made.code == 0)
    one = jaxcam.simulate(ImpactOscillator(), jnp.asarray(starts[3]), 0.1, 3.7)
    wanted = np.asarray(one.at(0.1 + 0.7 * np.arange(1.0, 6.0)))
    # the tolerance of the batch is 1e-9
    assert np.max(np.abs(made.states[3] - wanted)) < 1e-7


@pytest.mark.parametrize(
    "start, options, word",
    [
        ([np.nan, 0.0], {}, "finite"),
        ([2.0, 0.0], {}, "gap is negative"),
        ([0.0, 0.0, 0.0], {}, "components"),
        ([-0.5, 0.0], {"period": -1.0}, "period"),
    ],
)
def test_stroboscope_says_what_is_wrong(start, options, word):
    with pytest.raises(ValueError, match=word):
        stroboscope(ImpactOscillator(), np.array([start]), 2, **options)


def test_derivative_rules_of_the_reader_are_kept():
    # the derivative of an implicit function is not that of the iteration inside
    @jax.custom_jvp
    def root(x):
        return jax.lax.stop_gradient(jnp.sqrt(x))

    @root.defjvp
    def _(primals, tangents):
        (x,), (dx,) = primals, tangents
        return root(x), dx / (2 * root(x))

    example = jax.ShapeDtypeStruct((), jnp.float64)
    scalar = scalarise(lambda x: 3.0 * root(x), example)
    slope = jax.grad(lambda x: scalar(split(x)).item())(4.0)
    assert abs(float(slope) - 0.75) < 1e-15


def test_integers_known_while_tracing_are_combined_bit_by_bit():
    scalar = scalarise(
        lambda x: x * (jnp.arange(4) & 1).astype(x.dtype),
        jax.ShapeDtypeStruct((4,), jnp.float64),
    )
    made = scalar(split(jnp.ones(4)))
    assert [float(e) for e in made] == [0.0, 1.0, 0.0, 1.0]


class Weightless(jaxcam.HybridSystem):
    """A body at rest without a force, above a table that moves up and down."""

    lift: float = 0.5
    speed: float = 6.0

    @property
    def period(self):
        return 2 * jnp.pi / self.speed

    def table(self, t):
        return 0.5 * self.lift * (1 - jnp.cos(self.speed * t))

    def vector_field(self, t, state):
        return jnp.stack([state[1], jnp.zeros_like(state[1])])

    def gap(self, t, state):
        return state[0] - self.table(t)

    def impact(self, t, state):
        rate = jax.grad(self.table)(t)
        return jnp.stack([state[0], rate - 0.5 * (state[1] - rate)])


@pytest.mark.parametrize("height", [0.01, 0.25, 0.4999])
def test_at_rest_without_a_force_no_rise_of_the_surface_is_stepped_over(height):
    # the error of a step says nothing there; steps are a quarter of a period at most
    system = Weightless()
    period = 2 * np.pi / 6.0
    trajectory = jaxcam.simulate(system, jnp.array([height, 0.0]), 0.0, 20 * period)
    assert trajectory.successful
    first = np.arccos(1 - 2 * height / 0.5) / 6.0
    assert abs(trajectory.impacts.time[0] - first) < 1e-10
    assert float(trajectory.gap(np.linspace(0.0, 20 * period, 4001)).min()) > -1e-9


@pytest.mark.parametrize("gap", [0.0, 1e-17, -1e-17, 1e-13])
@pytest.mark.parametrize("speed", [1e-9, -1e-9, 1e-17, -1e-3])
@pytest.mark.parametrize(
    "system, surface",
    [(ImpactOscillator(2.8, 0.8, 0.3, 0.1), 0.3), (ImpactOscillator(2.8, 0.8), 0.0)],
)
def test_starts_within_rounding_of_the_surface(system, surface, gap, speed):
    # where the first hop was lower than rounding no step was short enough
    made = jaxcam.simulate(system, jnp.array([surface + gap, speed]), 0.0, 3.0)
    assert made.successful, made.result
    assert np.min(np.asarray(made.gap(made.steps.time))) >= -1e-12


def test_hops_before_a_release_do_not_sink_into_the_surface():
    """Close below the interruption of chattering contact lasts less than a hop.

    Rounding of each landing added up to more than the height of the next hop.
    """
    system = preset("calibrated")
    speed = rpm_to_rad_s(152.67692308)
    system = eqx.tree_at(lambda s: s.speed, system, jnp.asarray(speed))
    period = float(system.period)
    time = period / 4
    start = contact_state(system, jnp.array([time]), jnp.array([0.27, 0.0]))[0]
    made = jaxcam.simulate(system, start, time, time + 40 * period)
    assert made.successful, made.result
    assert np.min(np.asarray(made.gap(made.steps.time))) >= -1e-14


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_contact_whose_force_touches_zero_goes_on(damping):
    """At rest on a wall at exactly -1 the forcing lets go for an instant, every turn.

    A hop of no height once ended the run at the first of them. With a wall a millionth
    closer there are six releases in 40 s (at pi + 2 k pi), with one a millionth further
    away there is none.
    """
    for wall, releases in ((-1.0, 0), (-1.0 - 1e-6, 0), (-1.0 + 1e-6, 6)):
        system = ImpactOscillator(1.0, 0.1, wall, damping)
        found = jaxcam.simulate(system, jnp.array([wall, 0.0]), 0.0, 40.0)
        assert found.successful, found.result
        assert int(found.contacts.count) == releases + 1


@pytest.mark.parametrize("turns", [176, 1000])
def test_a_late_start_costs_no_more_than_an_early_one(turns):
    """Rounding of a late time is rounding of the cam's gap.

    Close below the interruption of chattering hops lower than it were chased: thirty
    times the attempts after 1000 turns, and some runs ended after 176.
    """
    system = preset("calibrated")
    speed = rpm_to_rad_s(152.6765)
    system = eqx.tree_at(lambda s: s.speed, system, jnp.asarray(speed))
    start, late = np.array([0.338, 0.224]), turns * float(system.period)
    early, after = (stroboscope(system, start, 30, t0=t0) for t0 in (0.0, late))
    assert int(early.code[0]) == int(after.code[0]) == 0
    assert int(after.steps[0]) <= 1.05 * int(early.steps[0])
    np.testing.assert_allclose(after.states, early.states, atol=1e-6)


@pytest.fixture
def compiled():
    """Names of the programs that jax compiles, or takes from its cache, meanwhile."""
    names = []

    def listen(event, _, **about):
        if event.endswith("backend_compile_duration"):
            names.append(about.get("fun_name"))

    monitoring.register_event_duration_secs_listener(listen)
    jax.jit(lambda x: x + 1.0)(0.0)
    assert names, "jax no longer reports what it compiles; listen to another event"
    names.clear()
    yield names
    monitoring.unregister_event_duration_listener(listen)


def test_another_length_compiles_nothing(compiled):
    # each new number of impacts once compiled a dozen copies and slices, 0.1 s in all
    system = CamFollower()

    def look(t1, samples):
        run = jaxcam.simulate(system, None, 0.0, t1)
        times = np.linspace(0.01, 2.0, samples)
        return int(run.impacts.count), run.final, run.at(times), run.gap(times)

    # lengths on the same side of a power of two, up to which they are padded
    first, *_ = look(2.5, 40)
    compiled.clear()
    second, *_ = look(2.9, 47)
    assert second != first
    assert compiled == []


def test_a_run_is_printed_in_a_line():
    run = jaxcam.simulate(BouncingBall(), jnp.array([1.0, 0.0]), 0.0, 1.0)
    said = f"impacts: {int(run.impacts.count)}, contacts: 0"
    assert str(run) == f"BouncingBall from 0 to 1 s, {said}"
    short = jaxcam.simulate(
        BouncingBall(), jnp.array([1.0, 0.0]), 0.0, 100.0, max_steps=16
    )
    assert str(short).endswith(short.result) and short.result
    heights = jnp.array([[1.0, 0.0], [2.0, 0.0]])
    many = jax.vmap(
        lambda x: jaxcam.simulate(BouncingBall(), x, 0.0, 1.0, max_steps=16)
    )(heights)
    assert str(many) == repr(many)


def test_a_finished_run_is_read_inside_a_program():
    run = jaxcam.simulate(CamFollower(), None, 0.0, 2.5)
    times = np.array([1.0, 2.0])
    for read in (lambda: run.final, lambda: run.at(times), lambda: run.gap(times)):
        plain, inside = read(), jax.jit(lambda c, read=read: c * read())(1.0)
        # a gap in contact is a difference of angles of 0.3 rad
        np.testing.assert_allclose(inside, plain, rtol=1e-13, atol=1e-15)


class Spring(jaxcam.HybridSystem):
    """A mass that falls on a floor, on a spring whose force is stated in many ways."""

    stiffness: float = 30.0
    way: str = eqx.field(static=True, default="plain")

    def force(self, height):
        if self.way == "rule":
            # a rule that needs the parameter of the moment
            @jax.custom_jvp
            def pull(z):
                return jax.lax.stop_gradient(self.stiffness * jnp.sin(z))

            @pull.defjvp
            def _(primals, tangents):
                (z,), (dz,) = primals, tangents
                return pull(z), self.stiffness * jnp.cos(z) * dz

            return -pull(height)
        if self.way == "rule of a number":
            return -jax.nn.relu(jnp.asarray(1.0)) * self.stiffness * jnp.sin(height)
        if self.way == "scan":
            # what a checkpoint leaves behind when it is differentiated
            def sine(z):
                return jax.lax.scan(lambda s, _: (jnp.sin(z), s), 0.0, length=2)[0]

            keep = jax.checkpoint_policies.everything_saveable
            return -self.stiffness * jax.checkpoint(sine, policy=keep)(height)
        if self.way == "mass matrix":
            mass = jnp.array([[2.0, 0.0], [0.0, 1.0]])
            pull = jnp.stack([2 * self.stiffness * jnp.sin(height), 0.0])
            return -jnp.linalg.solve(mass, pull)[0]
        return -self.stiffness * jnp.sin(height)

    def vector_field(self, t, state):
        return jnp.stack([state[1], self.force(state[0]) - 9.81])

    def gap(self, t, state):
        return state[0] + 0.2

    def impact(self, t, state):
        return state * jnp.array([1.0, -0.8])


@pytest.mark.parametrize("way", ["rule", "rule of a number", "scan", "mass matrix"])
def test_functions_may_be_written_in_any_way(way):
    plain, other = (
        jaxcam.simulate(Spring(way=w), [0.5, 0.0], 0.0, 3.0) for w in ("plain", way)
    )
    assert int(plain.impacts.count) == int(other.impacts.count) > 5
    np.testing.assert_allclose(other.impacts.time, plain.impacts.time, atol=1e-11)


def test_a_batch_may_need_a_library():
    plain = jaxcam.simulate(Spring(), [0.5, 0.0], 0.0, 3.0)
    system, starts = Spring(way="mass matrix"), np.array([[0.5, 0.0]] * 3)
    batch = stroboscope(system, starts, 3, period=1.0)
    for state in batch.states[:, -1]:
        np.testing.assert_allclose(state, plain.final, atol=1e-9)


class Cornered(HybridSystem):
    """A point that leans on two walls, pressed into the corner between them."""

    label: jax.Array | None = None

    def vector_field(self, t, state):
        return jnp.concatenate([state[2:], -jnp.ones(2)])

    def gap(self, t, state):
        return state[:2]

    def impact(self, t, state):
        return jnp.stack([state.at[2].multiply(-0.5), state.at[3].multiply(-0.5)])


def test_contacts_that_hold_at_the_start_are_not_lost_in_an_empty_run():
    """They belong to no row of the log: two contacts, one row."""
    run = jaxcam.simulate(Cornered(), jnp.zeros(4), 0.0, 0.0)
    assert int(run.contacts.count) == 2
    np.testing.assert_array_equal(run.contacts.constraint, [0, 1])
    np.testing.assert_array_equal(run.contacts.start, [0.0, 0.0])


def test_a_system_may_hold_a_random_key():
    run = jaxcam.simulate(Cornered(jax.random.key(0)), jnp.ones(4), 0.0, 0.1)
    assert run.successful


def test_what_passed_once_is_checked_again_with_other_numbers():
    """What is remembered is a system with all its numbers, not its kind."""
    system = CamFollower()
    jaxcam.simulate(system, None, 0.0, 0.01)
    wrong = eqx.tree_at(lambda s: s.inertia, system, jnp.asarray(-1.0))
    with pytest.raises(ValueError, match="inertia"):
        jaxcam.simulate(wrong, None, 0.0, 0.01)
