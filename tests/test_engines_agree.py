"""Two implementations of one motion: the loop, and one call of diffrax a flight."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from textbook_systems import BallBetweenWalls, parameters, TwoMasses

import jaxcam
from jaxcam.models import (
    BouncingBall,
    CamFollower,
    ImpactOscillator,
    TripleIntegrator,
)


# of positions, velocities and times; accuracy of the runs is a thousand times better
_AGREEMENT = 1e-9
_TOLERANCE = 1e-12


def _both(system, state, t0, t1):
    return [
        jaxcam.simulate(system, state, t0, t1, tolerance=_TOLERANCE, engine=engine)
        for engine in ("loop", "diffeqsolve")
    ]


def _assert_same(a, b):
    assert a.successful and b.successful, (a.result, b.result)
    # a contact that ends where it starts is a matter of rounding
    kept = [np.asarray(c.end - c.start) > _AGREEMENT for c in (a.contacts, b.contacts)]
    number = [int(np.sum(k)) for k in kept]
    assert number[0] == number[1]
    for name in ("start", "end", "constraint", "released"):
        left, right = (
            np.asarray(getattr(c, name), float)[k]
            for c, k in zip((a.contacts, b.contacts), kept, strict=True)
        )
        np.testing.assert_allclose(left, right, rtol=0, atol=_AGREEMENT, err_msg=name)
    # how many of the last, lowest hops of a chatter are listed is a matter of rounding
    hits = [_fast_impacts(trajectory) for trajectory in (a, b)]
    for name, left, right in zip(("constraint", "time", "before", "after"), *hits):
        scale = 1.0 if name == "time" else 1.0 + np.max(np.abs(left), initial=0.0)
        np.testing.assert_allclose(
            left, right, rtol=0, atol=scale * _AGREEMENT, err_msg=name
        )
    # inside a chatter a sample may fall between two slightly different impact times
    times = np.linspace(float(a.steps.time[0]), float(a.t1), 20)
    hit = np.concatenate([np.asarray(a.impacts.time), [np.inf]])
    clear = np.min(np.abs(times[:, None] - hit), axis=1) > 1e3 * _AGREEMENT
    left, right = np.asarray(a.at(times))[clear], np.asarray(b.at(times))[clear]
    scale = 1.0 + np.max(np.abs(left))
    np.testing.assert_allclose(left, right, rtol=0, atol=scale * _AGREEMENT)


def _fast_impacts(trajectory):
    impacts = trajectory.impacts
    speeds = np.asarray(impacts.speed_after)
    fast = speeds > 1e-3 * np.max(speeds, initial=0.0)
    names = ("constraint", "time", "before", "after")
    return [np.asarray(getattr(impacts, name), float)[fast] for name in names]


@pytest.mark.parametrize("seed", range(10))
def test_impact_oscillator(seed):
    random = np.random.default_rng(seed)
    wall = random.uniform(-0.2, 0.5)
    system = ImpactOscillator(
        omega=random.uniform(1.5, 3.5),
        restitution=random.uniform(0.4, 0.95),
        wall=wall,
        damping=random.uniform(0.0, 0.1),
    )
    state = [wall - random.uniform(0.05, 1.0), random.uniform(-1, 1)]
    _assert_same(*_both(system, state, 0.0, 6 * float(system.period)))


@pytest.mark.parametrize("seed", range(10))
def test_bouncing_ball(seed):
    random = np.random.default_rng(seed)
    system = BouncingBall(
        restitution=random.uniform(0.3, 0.9),
        amplitude=random.uniform(0.0, 0.1),
        frequency=random.uniform(5.0, 15.0),
    )
    state = [random.uniform(0.15, 0.5), random.uniform(-1, 1)]
    _assert_same(*_both(system, state, 0.0, 1.2))


@pytest.mark.parametrize("released", [True, False])
@pytest.mark.parametrize("seed", range(5))
def test_cam_follower(seed, released):
    random = np.random.default_rng(seed)
    system = CamFollower(speed=random.uniform(13.5, 17.0))
    state = None
    if not released:
        gap = -float(system.gap(0.0, jnp.zeros(2)))
        state = [gap + random.uniform(0.001, 0.1), random.uniform(-1, 1)]
    _assert_same(*_both(system, state, 0.0, 1.5 * float(system.period)))


@pytest.mark.parametrize("seed", range(6))
def test_triple_integrator(seed):
    random = np.random.default_rng(seed)
    system = TripleIntegrator(restitution=random.uniform(0.3, 0.9))
    state = [random.uniform(0.0, 1.0), random.uniform(0.0, 1.0), -3.0]
    _assert_same(*_both(system, state, 0.0, 4.0))


@pytest.mark.parametrize("seed", range(7))
def test_ball_between_walls(seed):
    random = np.random.default_rng(seed)
    system = BallBetweenWalls(
        **parameters(
            gravity=random.uniform(0.5, 10.0),
            width=1.0,
            restitution=random.uniform(0.5, 0.95),
        )
    )
    state = [random.uniform(0.1, 0.9), random.uniform(5.0, 20.0)]
    _assert_same(*_both(system, state, 0.0, 1.5))


@pytest.mark.parametrize("seed", range(7))
def test_two_masses(seed):
    random = np.random.default_rng(seed)
    system = TwoMasses(
        **parameters(
            omega=random.uniform(0.5, 2.0),
            stop=random.uniform(-0.3, 0.3),
            restitution=random.uniform(0.3, 0.9),
            force=random.uniform(0.5, 2.0),
            stiffness=1.0,
            damping=0.1,
        )
    )
    state = [-0.5, *random.uniform(-0.5, 0.5, 3)]
    _assert_same(*_both(system, state, 0.0, 2 * float(system.period)))


def test_implicit_solver():
    """A stiff damper and spring: an implicit solver flies it in few steps."""
    system = ImpactOscillator(omega=2.0, restitution=0.7, wall=0.2, damping=50.0)
    state = [-0.5, 0.0]
    exact = jaxcam.simulate(system, state, 0.0, 6.0, tolerance=1e-10)
    stiff = jaxcam.simulate(
        system,
        state,
        0.0,
        6.0,
        tolerance=1e-8,
        solver=diffrax.Kvaerno5(),
        engine="diffeqsolve",
    )
    assert stiff.successful
    assert stiff.steps.count < exact.steps.count
    times = np.linspace(0.0, 6.0, 25)
    np.testing.assert_allclose(stiff.at(times), exact.at(times), atol=1e-6)


def test_implicit_solver_with_impacts():
    system = ImpactOscillator(omega=2.8, restitution=0.8)
    state = [-0.5, 0.0]
    exact = jaxcam.simulate(system, state, 0.0, 6.0)
    implicit = jaxcam.simulate(
        system,
        state,
        0.0,
        6.0,
        tolerance=1e-9,
        solver=diffrax.Kvaerno5(),
        engine="diffeqsolve",
    )
    assert implicit.impacts.count == exact.impacts.count > 0
    np.testing.assert_allclose(implicit.impacts.time, exact.impacts.time, atol=1e-6)
    times = np.linspace(0.0, 6.0, 25)
    np.testing.assert_allclose(implicit.at(times), exact.at(times), atol=1e-5)


def test_traced_input_is_refused():
    def final(x):
        state = jnp.stack([x, jnp.zeros_like(x)])
        return jaxcam.simulate(
            BouncingBall(), state, 0.0, 1.0, engine="diffeqsolve"
        ).final

    with pytest.raises(ValueError, match='use engine="loop"'):
        jax.jvp(final, (jnp.asarray(1.0),), (jnp.asarray(1.0),))


def test_solver_without_error_estimate_is_refused():
    with pytest.raises(ValueError, match="Euler has no error estimate"):
        jaxcam.simulate(
            BouncingBall(),
            [1.0, 0.0],
            0.0,
            1.0,
            solver=diffrax.Euler(),
            engine="diffeqsolve",
        )


def test_budget_is_reported():
    trajectory = jaxcam.simulate(
        BouncingBall(), [1.0, 0.0], 0.0, 5.0, engine="diffeqsolve", max_steps=5
    )
    assert not trajectory.successful
    assert "max_steps" in trajectory.result
