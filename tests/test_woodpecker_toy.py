"""The woodpecker toy, against a time-stepping scheme written for it alone."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxcam
from jaxcam.models import WoodpeckerToy


# the first simulation compiles for more than a minute
pytestmark = pytest.mark.slow

START = (0.0, -0.6 / 5.8, -0.2788, -0.3411, 0.0, -7.4583)


def _stepped(start, duration: float, step: float):
    """Moreau's midpoint scheme with projected Gauss-Seidel iterations.

    **Returns:** times and states at the ends of the steps, `(n, 6)`.
    """
    bird, sleeve = 4.5e-3, 3e-4
    mass = np.array(
        [
            [bird + sleeve, bird * 0.01, bird * 0.015],
            [bird * 0.01, 5e-9 + bird * 0.01**2, bird * 0.01 * 0.015],
            [bird * 0.015, bird * 0.01 * 0.015, 7e-7 + bird * 0.015**2],
        ]
    )
    inverse = np.linalg.inv(mass)
    normals = np.array([[0, 0, -0.02], [0, 5.8e-3, 0], [0, -5.8e-3, 0]])
    slips = np.array([[1, 0.01, -5.1e-3], [1, 3.1e-3, 0], [1, 3.1e-3, 0]])
    free = np.array([2.4e-3, 6e-4, 6e-4])
    held, friction = np.array([0.5, 0.0, 0.0]), 0.3
    rows = np.concatenate([normals, slips])
    compliance = rows @ inverse @ rows.T
    q, u = np.array(start[:3]), np.array(start[3:])
    found = []
    for _ in range(round(duration / step)):
        middle = q + step / 2 * u
        twist = 5.6e-3 * (middle[2] - middle[1])
        weight = bird * 9.81
        force = np.array(
            [-(bird + sleeve) * 9.81, twist - weight * 0.01, -twist - weight * 0.015]
        )
        after = u + step * inverse @ force
        closed = np.flatnonzero(free + normals @ middle <= 0)
        if len(closed):
            before, push = rows @ u, np.zeros(6)
            for _ in range(200):
                old = push.copy()
                for k in closed:
                    gone = rows[k] @ after + compliance[k] @ push + held[k] * before[k]
                    push[k] = max(0.0, push[k] - gone / compliance[k, k])
                    slip = rows[k + 3] @ after + compliance[k + 3] @ push
                    most = friction * push[k]
                    trial = push[k + 3] - slip / compliance[k + 3, k + 3]
                    push[k + 3] = min(most, max(-most, trial))
                if np.max(np.abs(push - old)) < 1e-16:
                    break
            after = after + inverse @ rows.T @ push
        u = after
        q = middle + step / 2 * u
        found.append(np.concatenate([q, u]))
    return step * np.arange(1, len(found) + 1), np.array(found)


@pytest.fixture(scope="module")
def run():
    return jaxcam.simulate(WoodpeckerToy(), jnp.array(START), 0.0, 0.4)


def test_the_motion_agrees_with_time_stepping(run):
    """Beak impacts to 5e-5 s, states to 1 %, with steps of 5e-6 s."""
    assert run.successful, run.result
    time, states = _stepped(START, 0.4, 5e-6)
    jumps = np.flatnonzero(np.diff(-0.02 * states[:, 5]) > 0.05)
    expected = time[jumps[np.diff(jumps, prepend=-100) > 20] + 1]
    impacts = run.impacts
    beak = np.asarray(impacts.time)[np.asarray(impacts.constraint) == 0]
    beak = beak[np.isfinite(beak)]
    assert len(beak) == 3
    np.testing.assert_allclose(beak, expected, atol=5e-5)
    at = np.array([0.05, 0.1, 0.15, 0.2, 0.3, 0.35, 0.399])
    found = np.asarray(run.at(jnp.asarray(at)))
    stepped = states[np.rint(at / 5e-6).astype(int) - 1]
    size = np.max(np.abs(states), axis=0)
    assert np.max(np.abs(found - stepped) / size[None]) < 0.01


def test_the_toy_pecks_every_146_ms_and_slides_down(run):
    """The period to 0.3 ms; 19 mm per beak impact, to 1.5 mm."""
    impacts = run.impacts
    on_beak = np.asarray(impacts.constraint) == 0
    beak = np.asarray(impacts.time)[on_beak]
    beak = beak[np.isfinite(beak)]
    np.testing.assert_allclose(np.diff(beak), 0.146, atol=3e-4)
    heights = np.asarray(run.at(jnp.asarray(beak)))[:, 0]
    np.testing.assert_allclose(np.diff(heights), -0.0187, atol=1.5e-3)


def test_the_sleeve_jams_and_the_toy_stands_still(run):
    """On the lower edge of the sleeve, for more than 10 ms, in every period."""
    contacts = run.contacts
    edge = np.asarray(contacts.constraint)
    begins, ends = np.asarray(contacts.start), np.asarray(contacts.end)
    for start in (0.03, 0.18, 0.33):
        held = (begins <= start) & (ends >= start + 0.01)
        assert edge[held].tolist() == [1]
        still = np.asarray(run.at(start + jnp.linspace(0.0, 0.01, 5)))[:, 3]
        assert np.max(np.abs(still)) < 1e-12
