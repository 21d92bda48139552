"""The fitted local map: its algebra on lobes that follow the law exactly."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.models import ImpactOscillator
from variational import (
    chatter_interruption,
    find_lobes,
    fit_local_map,
    iterate_local_map,
    scaling_law,
    section_turn,
)
from variational.chatter import Lobes


Q, M, X, HEIGHT, WIDTH = -0.62, -0.535, 0.34, 2.2e-4, 1.0e-3


def first_lobe(depth):
    """A lobe with a root corner on its right, and its slope; depth from 0 to 1."""
    y = depth * WIDTH
    c1 = -1.5
    root = (HEIGHT - c1 * -WIDTH) / np.sqrt(WIDTH)
    return 0.3366 - c1 * y + root * np.sqrt(y), c1 - root / (2 * np.sqrt(y))


def made_lobes():
    k = np.arange(7)
    corners = X - WIDTH * (1 - np.exp(k * M)) / (1 - np.exp(M))
    values = 0.3366 + HEIGHT * (1 - np.exp(k * Q)) / (1 - np.exp(Q))
    depth = np.linspace(1e-9, 1, 400) ** 2
    image, slope = first_lobe(depth)
    points = X - WIDTH * depth
    nothing = np.zeros(0)
    return Lobes(
        corners=corners,
        values=values,
        points=points[None],
        images=image[None],
        slopes=slope[None],
        accumulation=float(X - WIDTH / (1 - np.exp(M))),
        limit=float(0.3366 + HEIGHT / (1 - np.exp(Q))),
        scan=nothing,
        scanned=nothing,
        impacts=nothing,
    )


def test_fit_recovers_scales_lobe_and_accumulation():
    lobes = made_lobes()
    local = fit_local_map(lobes)
    assert abs(float(local.Q) - Q) < 1e-10
    assert abs(float(local.M) - M) < 1e-10
    assert abs(float(local.x_inf) - lobes.accumulation) < 1e-12
    assert abs(float(local.alpha_inf) - lobes.limit) < 1e-12
    inside = jnp.asarray(lobes.points[0][1:-1])
    # the slopes are read off by linear interpolation between 400 points
    error = np.abs(np.asarray(local(inside)) - lobes.images[0][1:-1])
    assert np.max(error) < 0.01 * HEIGHT
    # (5.4) repeats the lobe, scaled, and is continuous (below 5.27)
    for k in (1, 2, 3):
        at = lobes.corners[k]
        either = local(jnp.asarray([at + 1e-13, at - 1e-13]))
        assert np.max(np.abs(np.asarray(either) - lobes.values[k])) < 0.02 * HEIGHT
        scaled = at - np.exp(k * M) * (X - lobes.points[0][1:-1])
        value = lobes.values[k] + np.exp(k * Q) * (lobes.images[0][1:-1] - 0.3366)
        assert np.max(np.abs(np.asarray(local(scaled)) - value)) < 0.01 * HEIGHT
    assert float(local(lobes.accumulation - 1e-4)) == float(local.alpha_inf)
    assert np.isnan(float(local(X + 1e-6)))
    assert np.isnan(float(local(np.nan)))


def test_iteration_moves_from_the_fixed_point_into_the_lobes():
    local = fit_local_map(made_lobes())
    to_edge = float(local.x_inf - local.alpha_inf)
    span = float(local.x_0 - local.x_inf)
    kept = iterate_local_map(local, np.array([to_edge - 1e-5, to_edge + 0.4 * span]))
    spread = np.ptp(np.asarray(kept), axis=1)
    assert spread[0] == 0.0
    assert np.isfinite(spread[1])


@pytest.mark.slow
def test_lobes_of_the_motion_are_found():
    # x'' + x = cos wt at its interruption for r = 0.5, lobes in the position
    system = ImpactOscillator(omega=jnp.asarray(1.0), restitution=jnp.asarray(0.5))
    value = chatter_interruption(system, lambda s: s.omega, (0.4, 0.8))
    system = ImpactOscillator(omega=value, restitution=jnp.asarray(0.5))
    # half a period after the middle of contact nothing touches
    start = jnp.asarray([0.0, 0.0])
    for _ in range(3):
        arrived = section_turn(system, start, 0.45)
        start = arrived.state
    shares = []
    lobes = find_lobes(
        system,
        start,
        np.linspace(-0.02, 0.02, 192),
        phase=0.45,
        most=9,
        progress=shares.append,
    )
    assert shares == sorted(shares) and 0 < shares[0] < 0.1 and shares[-1] == 1.0
    law = scaling_law(0.5)
    widths = np.abs(np.diff(lobes.corners))
    heights = np.abs(np.diff(lobes.values))
    # the scales are approached as the lobes become small
    assert abs(widths[-1] / widths[-2] / float(law.q) - 1) < 0.03
    assert abs(heights[-1] / heights[-2] / float(law.p) ** 2 - 1) < 0.03
    # at the interruption the lobes start at the fixed point itself
    assert abs(lobes.accumulation - float(start[0])) < 1e-9
