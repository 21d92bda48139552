"""Orbits between two walls: a symmetric system with pitchforks, grazings and loops.

Truth: the symmetry (time half a period later, x to -x), the determinant, a simulation.
"""

import jax.numpy as jnp
import numpy as np
import pytest

import continuation
import jaxcam
from variational import orbit_of


class Walls(jaxcam.HybridSystem):
    """x'' + 0.05 x' + x = cos(omega t) between walls at -0.5 and 0.5."""

    omega: float = 1.0
    restitution: float = 0.8

    def vector_field(self, t, state):
        pull = jnp.cos(self.omega * t) - 0.05 * state[1] - state[0]
        return jnp.stack([state[1], pull])

    def gap(self, t, state):
        return jnp.stack([0.5 - state[0], state[0] + 0.5])

    def impact(self, t, state):
        after = jnp.stack([state[0], -self.restitution * state[1]])
        return jnp.stack([after, after])

    @property
    def period(self):
        return 2 * jnp.pi / self.omega


BOUNDS = (0.95, 1.6)


def omega(system):
    return system.omega


@pytest.mark.slow
def test_switched_branches_between_two_walls():
    """Pitchforks converge, the loop between them is gone round once, multipliers at
    grazings are infinite and zero, and the two branches are mirror images to 1e-8."""
    orbit = continuation.periodic_orbit(Walls())
    trunk = continuation.branch(Walls(), orbit, omega, BOUNDS)
    forks = trunk.of_kind("branch point")
    assert len(forks) == 2
    for fork in forks:
        assert fork.converged
        assert min(abs(fork.multipliers - 1.0)) < 1e-7
        # the symmetric orbit: half a period later the other wall is hit
        (t1, *x1), (t2, *x2) = fork.state.reshape(2, 3)
        assert abs(t2 - t1) == pytest.approx(0.5, abs=1e-9)
        assert x2 == pytest.approx([-value for value in x1], abs=1e-9)
    one, other = continuation.switch(forks[0], omega, BOUNDS)
    for half in (one, other):
        assert half.reason == "the branch is closed: back at its start"
        assert len(half.points) < 400
        assert [p.kind for p in half.special].count("branch point") == 2
        assert all(p.converged for p in half.special)
    assert_mirror_images(one, other)
    assert_grazings_are_limits(one)
    # an orbit on the branch is one of the event loop
    point = one.regular[12]
    period = float(point.observed["period"])
    state = point.observed["stroboscopic"][0]
    found = orbit_of(Walls(point.parameter), state, period, closure=1e-8)
    assert np.sort_complex(np.asarray(found.multipliers)) == pytest.approx(
        np.sort_complex(point.multipliers), abs=1e-7
    )


def assert_mirror_images(one, other):
    """The same special points, with impacts half a period later at -x.

    Other points differ: steps are measured by the size of the unknowns, phases too.
    """
    assert len(one.special) == len(other.special) > 6
    for a, b in zip(one.special, other.special, strict=True):
        assert a.kind == b.kind
        assert abs(a.parameter - b.parameter) < 1e-8
        rows, mirrored = a.state.reshape(-1, 3), b.state.reshape(-1, 3).copy()
        mirrored[:, 0] += 0.5
        mirrored[:, 1:] *= -1
        mirrored[:, 0] %= 1.0
        phases = rows[:, 0] % 1.0
        order, its = np.argsort(phases), np.argsort(mirrored[:, 0])
        assert np.max(np.abs(phases[order] - mirrored[its, 0])) < 1e-8
        assert np.max(np.abs(rows[order, 1:] - mirrored[its, 1:])) < 1e-8


def assert_grazings_are_limits(branch):
    """Next to a grazing the multipliers grow with the sign told there, and their
    product stays that of restitution and damping."""
    found = 0
    points = branch.points
    for k, point in enumerate(points):
        if point.kind != "grazing" or np.isfinite(point.multipliers[0]):
            continue
        found += 1
        assert "infinite" in point.reason and point.stable is None
        assert np.isinf(point.multipliers[0].real)
        assert abs(point.multipliers[1]) < 1e-9
        before = points[k - 1]
        assert np.sign(before.multipliers[0].real) == np.sign(point.multipliers[0].real)
        impacts = before.state.size // 3
        damped = np.exp(-0.05 * float(before.observed["period"]))
        product = np.prod(before.multipliers).real
        assert product == pytest.approx(0.8 ** (2 * impacts) * damped, rel=1e-8)
    assert found == 2
