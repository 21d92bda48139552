"""The loop compiled by LLVM gives the same motion as by XLA, to rounding."""

import logging

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from test_motion_together import Stack
from textbook_systems import BallBetweenWalls, parameters, TwoMasses, TwoStops

import jaxcam
from benchmarks import _attack_systems
from jaxcam.hybrid import HybridSystem, Settings, stroboscope
from jaxcam.hybrid.backend import _attempts
from jaxcam.models import (
    BouncingBall,
    CamFollower,
    ConstantRestitution,
    DesmodromicCam,
    FourierProfile,
    ImpactOscillator,
    MotionProgram,
    preset,
    Segment,
    TripleIntegrator,
    ValveTrain,
)


_TOLERANCE = 1e-10
_LLVM = Settings(tolerance=1e-9, chatter_depth=1.0, backend="llvm")
_VALVE = ValveTrain(
    profile=FourierProfile(0.005, [-0.005], [0.0]),
    speed=300.0,
    mass=0.2,
    stiffness=30e3,
    preload=250.0,
    damping=2.0,
)
_FLANKS = DesmodromicCam(
    profile=MotionProgram(
        [
            Segment("cycloidal", np.pi, 0.01),
            Segment("cycloidal", np.pi, -0.01),
        ]
    ),
    speed=200.0,
    clearance=2e-4,
    stiffness=500.0,
    preload=5.0,
    restitution=ConstantRestitution(0.3),
)
_CHAIN = dict(omega=1.7, stop=0.3, restitution=0.7, force=1.0, stiffness=1.0)
#: a system, a start, and how long it is followed (s)
_CASES = {
    "ball": (
        BouncingBall(amplitude=0.02, frequency=31.0, restitution=0.6),
        [0.3, 0],
        2,
    ),
    "zeno": (BouncingBall(restitution=0.8), [1.0, 0.0], 6.0),
    "oscillator": (ImpactOscillator(omega=2.8, restitution=0.8), [-0.5, 0.0], 15.0),
    "cam": (CamFollower(), None, 1.5),
    "calibrated cam": (preset("calibrated"), None, 1.0),
    "triple": (TripleIntegrator(restitution=0.6), [0.01, 0.0, -1.0], 3.0),
    "valve": (_VALVE, [0.002, 0.0], 0.1),
    "flanks": (_FLANKS, [1e-4, 0.0], 0.05),
    "walls": (
        BallBetweenWalls(**parameters(gravity=9.81, width=0.7, restitution=0.8)),
        [0.3, 4.0],
        3.0,
    ),
    "chain": (TwoMasses(**parameters(**_CHAIN, damping=0.1)), [0, 0, 0.5, 0], 20.0),
    "two stops": (TwoStops(**parameters(**_CHAIN, damping=0.1)), [0, 0, 0.5, 0], 9.0),
    "stack": (
        Stack(**parameters(first=9.8, second=12.0, floor=0.5, between=0.4, mass=2.0)),
        [0.2, 0.9, 0.0, 0.5],
        0.45,
    ),
}


def _runs(system, state, length, t0=0.0, tolerance=_TOLERANCE, **options):
    state = None if state is None else np.asarray(state, dtype=float)
    return [
        jaxcam.simulate(
            system,
            state,
            t0,
            length,
            settings=Settings(tolerance=tolerance, backend=backend, **options),
        )
        for backend in ("llvm", "xla")
    ]


def _assert_same(runs, length, accuracy=1e-9):
    """Events to an accuracy relative to the run, states between them to that of theirs.

    How many of the last hops of a chatter are listed is a matter of rounding.
    """
    first, second = runs
    assert int(first.code) == int(second.code)
    counts = [(int(m.impacts.count), int(m.contacts.count)) for m in runs]
    assert counts[0] == counts[1]
    for name in ("time", "before", "after", "constraint"):
        one, other = (np.asarray(getattr(m.impacts, name), float) for m in runs)
        size = length if name == "time" else 1 + np.max(np.abs(other), initial=0.0)
        np.testing.assert_allclose(one, other, rtol=0, atol=accuracy * size)
    for name in ("start", "end", "released", "constraint"):
        one, other = (np.asarray(getattr(m.contacts, name), float) for m in runs)
        np.testing.assert_allclose(one, other, rtol=0, atol=accuracy * length)
    size = np.max(np.abs(np.asarray(second.steps.state)), axis=0)
    one, other = (np.asarray(m.final) for m in runs)
    np.testing.assert_allclose(one / size, other / size, rtol=0, atol=accuracy)


@pytest.mark.parametrize("name", _CASES)
def test_models(name):
    system, state, length = _CASES[name]
    runs = _runs(system, state, length)
    assert int(runs[0].impacts.count) > 2
    _assert_same(runs, length)


def test_chatter_and_release_are_in_the_cases():
    """So that the comparison says something."""
    run = _runs(*_CASES["cam"])[0]
    assert int(run.contacts.count) >= 2 and bool(np.any(run.contacts.released))


@given(seed=st.integers(0, 10**6))
@settings(max_examples=6)
def test_random_systems(seed):
    """Up to several walls, kicks and units; the first impacts, before chaos sets in."""
    system, state, t0, t1 = _attack_systems.stated(_attack_systems.draw(seed))
    length = 0.2 * (t1 - t0)
    first, second = _runs(system, state, t0 + length, t0)
    assert int(first.code) == int(second.code)
    number = min(int(first.impacts.count), 5)
    assert int(second.impacts.count) >= number
    for name, size in (("time", length), ("constraint", 1.0)):
        one, other = (
            np.asarray(getattr(m.impacts, name), float)[:number]
            for m in (first, second)
        )
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-6 * size)


class Written(HybridSystem):
    """A body on a bed that is stated by branches, loops and a table."""

    restitution: float = 0.7

    @property
    def period(self):
        return 2.0

    def vector_field(self, t, state):
        x, v = state
        # stiffening by a branch, damping by a table, a drive by a loop
        spring = jax.lax.cond(x > 0.5, lambda: -4.0 * x + 1.0, lambda: -2.0 * x)
        damping = jnp.interp(x, jnp.array([0.0, 0.5, 1.0]), jnp.array([0.1, 0.2, 0.1]))
        drive = jax.lax.fori_loop(
            1, 4, lambda k, total: total + jnp.cos(k * jnp.pi * t) / k, 0.0
        )
        return jnp.stack([v, spring - damping * v + drive - 1.0])

    def gap(self, t, state):
        def off(carry):
            root, count = carry
            return (jnp.abs(root * root - 2.0) > 1e-12) & (count < 20)

        root, _ = jax.lax.while_loop(
            off, lambda c: (0.5 * (c[0] + 2.0 / c[0]), c[1] + 1), (1.0, 0)
        )
        return state[0] + 0.1 * root * jnp.exp(-state[0] * 0.0)

    def impact(self, t, state):
        speed = jnp.abs(state[1])
        r = jnp.where(speed > 1.0, self.restitution * speed**-0.1, self.restitution)
        return jnp.stack([state[0], -r * state[1]])


def test_branches_loops_and_tables_of_the_reader():
    """At a jump of the field the step length hangs on rounding: at 1e-10 both runs have
    errors of 1e-8 on some processors, so that they are compared at 1e-12."""
    _assert_same(_runs(Written(), [0.4, 0.0], 6.0, tolerance=1e-12), 6.0)


class Coupled(HybridSystem):
    """Two bodies with a matrix of mass that is solved for."""

    coupling: float = 0.3

    def vector_field(self, t, state):
        mass = jnp.array([[1.0, 0.0], [0.0, 1.0]]) + self.coupling * jnp.array(
            [[0.0, 1.0], [1.0, 0.0]]
        )
        force = jnp.stack([-9.81 - state[0], -state[1]])
        return jnp.concatenate([state[2:], jnp.linalg.solve(mass, force)])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return state.at[2].multiply(-0.5)


def test_what_is_lacking_runs_by_xla_and_is_said_once(caplog):
    _attempts._SAID.clear()
    state, either = [0.5, 0.0, 0.0, 0.0], Settings(backend="auto")
    with caplog.at_level(logging.WARNING, logger="jaxcam"):
        for _ in range(2):
            run = jaxcam.simulate(Coupled(), state, 0.0, 0.5, settings=either)
            assert run.successful and int(run.impacts.count) > 0
    said = [r.getMessage() for r in caplog.records]
    assert len(said) == 1 and "XLA" in said[0]
    with pytest.raises(ValueError, match="backend"):
        only = Settings(backend="llvm")
        jaxcam.simulate(Coupled(), state, 0.0, 0.5, settings=only)


class WithKey(ImpactOscillator):
    """A system that holds a random key, whose type LLVM has not."""

    key: jax.Array = eqx.field(default_factory=lambda: jax.random.key(0))


def test_a_random_key_is_left_to_xla():
    system = WithKey(omega=2.8, restitution=0.8)
    either = Settings(backend="auto")
    run = jaxcam.simulate(system, [-0.5, 0.0], 0.0, 5.0, settings=either)
    assert run.successful and int(run.impacts.count) > 0


@pytest.mark.parametrize("name", ["oscillator", "ball", "cam"])
def test_batches(name):
    """Samples, counts and codes of lanes that differ in a parameter; any number."""
    system = _CASES[name][0]
    rng = np.random.default_rng(1)
    starts = {
        "oscillator": rng.uniform(-1, -0.1, (21, 2)),
        "ball": rng.uniform(0.1, 0.5, (21, 2)),
        "cam": np.stack([rng.uniform(0.35, 0.5, 21), rng.uniform(-1, 1, 21)], axis=1),
    }[name]
    picks = {
        "oscillator": (lambda s: s.omega, np.linspace(2.5, 3.0, 21)),
        "ball": (lambda s: s.restitution, np.linspace(0.3, 0.7, 21)),
        "cam": (lambda s: s.speed, np.linspace(13.0, 15.0, 21)),
    }
    where, values = picks[name]
    made = [
        stroboscope(
            system,
            starts,
            6,
            skip=2,
            where=where,
            values=values,
            settings=Settings(tolerance=1e-10, backend=backend),
        )
        for backend in ("llvm", "xla")
    ]
    for part in ("code", "impacts", "hits", "rests"):
        np.testing.assert_array_equal(*(getattr(m, part) for m in made))
    np.testing.assert_allclose(*(m.states for m in made), rtol=0, atol=1e-8)


def test_a_budget_ends_a_batch_element_and_no_other():
    system = ImpactOscillator(omega=2.8, restitution=0.8)
    starts = np.random.default_rng(2).uniform(-1, -0.1, (11, 2))
    full = stroboscope(system, starts, 8, settings=_LLVM)
    most = int(np.median(full.steps))
    cut = stroboscope(system, starts, 8, max_steps=most, settings=_LLVM)
    over = full.steps > most
    assert np.any(over) and not np.all(over)
    np.testing.assert_array_equal(cut.code, np.where(over, 1, 0))
    np.testing.assert_array_equal(cut.steps, np.minimum(full.steps, most))
    np.testing.assert_array_equal(cut.states[~over], full.states[~over])
    assert np.all(np.isnan(cut.states[over][:, -1]))


def test_company_changes_no_result():
    """Alone, in another order, in threads: bit by bit."""
    system = ImpactOscillator(omega=2.8, restitution=0.8)
    starts = np.random.default_rng(3).uniform(-1, -0.1, (19, 2))
    full = stroboscope(system, starts, 10, settings=_LLVM)
    back = stroboscope(system, starts[::-1], 10, settings=_LLVM)
    np.testing.assert_array_equal(full.states, back.states[::-1])
    threads = stroboscope(system, starts, 10, workers=3, block=4, settings=_LLVM)
    np.testing.assert_array_equal(full.states, threads.states)
    alone = stroboscope(system, starts[:1], 10, settings=_LLVM)
    np.testing.assert_array_equal(full.states[:1], alone.states)


def test_a_long_run_goes_on_where_a_call_ends(monkeypatch):
    """Calls of few rounds, with what is at work kept in between."""
    system = ImpactOscillator(omega=2.8, restitution=0.8)
    starts = np.random.default_rng(4).uniform(-1, -0.1, (13, 2))
    full = stroboscope(system, starts, 10, settings=_LLVM)
    monkeypatch.setattr(_attempts, "_PATIENCE", 7)
    short = stroboscope(system, starts, 10, settings=_LLVM)
    np.testing.assert_array_equal(full.states, short.states)
    np.testing.assert_array_equal(full.steps, short.steps)


def test_a_budget_of_rows_and_progress():
    """A run by chunks is the run as a whole; it says how far it is."""
    system, seen = ImpactOscillator(omega=2.8, restitution=0.8), []
    run = jaxcam.simulate(
        system, [-0.5, 0.0], 0.0, 900.0, settings=_LLVM, progress=seen.append
    )
    assert run.successful and seen[-1] == 1.0 and len(seen) > 2
    assert seen == sorted(seen)
    short = jaxcam.simulate(
        system, [-0.5, 0.0], 0.0, 900.0, settings=_LLVM, max_steps=3000
    )
    assert int(short.code) == 1
    count = int(short.impacts.count)
    np.testing.assert_array_equal(short.impacts.time, run.impacts.time[:count])


@pytest.mark.parametrize("backend", ["llvm", "xla"])
def test_max_steps_is_kept_exactly(backend):
    """One row more than attempts, because the start has a row and short steps never
    fail. Neither the chunks of 2048 attempts nor blocks of 16 divide the number.
    """
    made = jaxcam.simulate(
        ImpactOscillator(omega=2.8, wall=9.0), [-0.5, 0.0], 0.0, 900.0,
        settings=Settings(max_step=0.02, backend=backend), max_steps=2501,
    )  # fmt: skip
    assert int(made.code) == 1
    assert len(made.steps.time) == 2502


def test_settings_name_the_back_end(unchecked_types):
    with pytest.raises(ValueError, match="backend"):
        stroboscope(
            ImpactOscillator(omega=2.8), [-0.5, 0.0], 2, settings=Settings(backend="c")
        )
