"""The event loop without any of the passes that make it fast gives the same motion."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from test_motion_together import Stack
from textbook_systems import parameters

import jaxcam
from jaxcam.hybrid import flow, Settings, stroboscope
from jaxcam.models import BouncingBall, CamFollower, ImpactOscillator, rpm_to_rad_s


_BALL = BouncingBall(amplitude=0.02, frequency=31.0, restitution=0.6)
_OSCILLATOR = ImpactOscillator(omega=2.8, restitution=0.8)
_RIG = eqx.tree_at(lambda s: s.speed, CamFollower(), jnp.asarray(rpm_to_rad_s(145.0)))
_STACK = Stack(**parameters(first=9.8, second=12.0, floor=0.5, between=0.4, mass=2.0))
#: a system, a start, and how long it is followed (s)
_CASES = {
    "ball": (_BALL, [0.3, 0.0], 2.0),
    "oscillator": (_OSCILLATOR, [-0.5, 0.0], 20.0),
    "rig": (_RIG, None, 1.0),
    "stack": (_STACK, [0.2, 0.9, 0.0, 0.5], 0.45),
}
# without the passes a program takes minutes to compile
_SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    "case",
    ["ball", "oscillator", *(pytest.param(c, marks=_SLOW) for c in ("rig", "stack"))],
)
def test_trajectories_are_equal(case):
    """Events agree to 1e-9 s, states to 1e-8 of the motion, tolerance 1e-11."""
    system, state, length = _CASES[case]
    state = None if state is None else np.asarray(state)
    made = [
        jaxcam.simulate(
            system, state, 0.0, length, settings=Settings(tolerance=1e-11, plain=plain)
        )
        for plain in (False, True)
    ]
    counts = [(int(m.code), int(m.impacts.count), int(m.contacts.count)) for m in made]
    assert counts[0] == counts[1] and counts[0][1] > 2
    for times in zip(*((m.impacts.time, m.contacts.end) for m in made), strict=True):
        np.testing.assert_allclose(*times, rtol=0, atol=1e-9)
    grid = np.linspace(0.0, length, 50)
    first, second = (np.asarray(m.at(grid)) for m in made)
    size = np.max(np.abs(first), axis=0)
    np.testing.assert_allclose(first / size, second / size, rtol=0, atol=1e-8)


@_SLOW
def test_derivatives_and_batches_are_equal():
    """By the start to 1e-8, also where lanes of a batch are compiled together."""
    starts = jnp.asarray([[-0.5, 0.0], [-0.2, 0.3], [-0.9, 0.1]])

    def end(state, plain):
        settings = Settings(tolerance=1e-11, plain=plain)
        return flow(_OSCILLATOR, state, 0.0, 4.0, settings=settings).state

    for function in (end, jax.jacfwd(end)):
        batch = jax.vmap(function, in_axes=(0, None))
        np.testing.assert_allclose(
            batch(starts, True), batch(starts, False), rtol=1e-8, atol=1e-9
        )


@_SLOW
def test_stroboscopes_are_equal():
    """States once a turn to 1e-9, over three turns of stable motion."""
    starts = jnp.asarray([[-0.5, 0.0], [-0.2, 0.3]])
    made = [
        stroboscope(_OSCILLATOR, starts, 3, settings=Settings(1e-11, plain=plain))
        for plain in (False, True)
    ]
    np.testing.assert_allclose(made[0].states, made[1].states, rtol=0, atol=1e-9)
