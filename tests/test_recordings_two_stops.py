"""A cart between two stops: each impact on its own side, each stop with its own law."""

import functools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxcam import fitting
from jaxcam.hybrid import HybridSystem
from jaxcam.recordings import Recording, segment


NOISE, INTERVAL = 1e-5, 5e-4
TRUTH = {
    "stiffness": 60.7,
    "damping": 0.15,
    "left": -0.0502,
    "right": 0.0797,
    "r_left": 0.78,
    "r_right": 0.63,
}
STATED_LEFT, STATED_RIGHT, TOLERANCE = -0.05, 0.08, 6e-4


class Cart(HybridSystem):
    """A sprung cart between two stops."""

    state_names = ("position", "velocity")

    stiffness: float = 61.5
    damping: float = 0.12
    left: float = STATED_LEFT
    right: float = STATED_RIGHT
    r_left: float = 0.75
    r_right: float = 0.6

    def vector_field(self, t, state):
        pull = self.stiffness * state[0] + self.damping * state[1]
        return jnp.stack([state[1], -pull])

    def gap(self, t, state):
        return jnp.stack([state[0] - self.left, self.right - state[0]])

    def impact(self, t, state):
        x, v = state
        after = jnp.stack([-self.r_left * v, -self.r_right * v])
        return jnp.stack([jnp.stack([x, after[0]]), jnp.stack([x, after[1]])])


@functools.cache
def recorded(seed: int):
    """Released three times, flight by flight with DOP853; and the true impacts."""
    rng = np.random.default_rng(seed)
    stops = np.array([TRUTH["left"], TRUTH["right"]])
    r = np.array([TRUTH["r_left"], TRUTH["r_right"]])

    def field(t, y):
        return [y[1], -TRUTH["stiffness"] * y[0] - TRUTH["damping"] * y[1]]

    events = [lambda t, y: y[0] - stops[0], lambda t, y: stops[1] - y[0]]
    for event in events:
        event.terminal, event.direction = True, -1  # pyright: ignore
    found = []
    for speed in (2.4, -2.6, 2.9):
        time = INTERVAL * np.arange(1200)
        x, hits = np.zeros(len(time)), []
        t, y = 0.0, np.array([0.0, speed])
        while t < time[-1]:
            part = solve_ivp(
                field,
                (t, time[-1]),
                y,
                "DOP853",
                events=events,
                dense_output=True,
                rtol=1e-11,
                atol=1e-13,
            )
            inside = (time >= t) & (time <= part.t[-1])
            x[inside] = part.sol(time[inside])[0]  # pyright: ignore
            t = part.t[-1]
            if part.status == 1:
                side = int(len(part.t_events[1]) > 0)  # pyright: ignore
                hits.append((t, side))
                y = np.array([stops[side], -r[side] * part.y[1, -1]])
        x = x + NOISE * rng.standard_normal(len(x))
        found.append((Recording(f"{speed} m/s", time, {"x": x}), np.array(hits)))
    return found


def cut(recording):
    return segment(
        recording,
        "x",
        STATED_LEFT,
        upper=STATED_RIGHT,
        tolerance=TOLERANCE,
        noise=NOISE,
    )


def test_every_impact_is_on_the_side_that_was_hit():
    """Times within 0.1 ms; every speed of approach is positive."""
    for recording, hits in recorded(0):
        impacts = cut(recording).impacts
        # as near to an end of the record as 10 ms an impact need not show
        clear = hits[(hits[:, 0] > 0.01) & (hits[:, 0] < 0.589)]
        assert impacts.count == len(clear) > 3
        assert np.max(np.abs(impacts.time - clear[:, 0])) < 1e-4
        assert np.array_equal(impacts.side, clear[:, 1])
        assert np.all(impacts.approach > 0) and np.all(impacts.separation > 0)


def test_a_stop_that_is_not_stated_makes_no_impact_on_the_other():
    """With the left stop alone, jumps at the right one are none of its impacts."""
    for recording, hits in recorded(0):
        impacts = segment(
            recording, "x", STATED_LEFT, tolerance=TOLERANCE, noise=NOISE
        ).impacts
        assert impacts.count > 0
        assert np.all(impacts.approach > 0)
        left = hits[hits[:, 1] == 0, 0]
        nearest = np.min(np.abs(impacts.time[:, None] - left), axis=1)
        assert np.max(nearest) < 1e-3


def test_only_an_upper_surface_mirrors_everything():
    """The same record upside down, cut at a surface above: the same impacts."""
    time = 1e-3 * np.arange(600)
    past = time - 0.3
    height = np.where(
        past < 0, 1.5 * time - 5 * time**2, 0.9 * past - 5 * past**2
    ) + 1e-5 * np.random.default_rng(2).standard_normal(len(time))
    ups = segment(Recording("up", time, {"x": height}), "x", 0.0, noise=1e-5)
    down = Recording("down", time, {"x": -height})
    downs = segment(down, "x", upper=0.0, noise=1e-5)
    assert ups.impacts.count == downs.impacts.count > 0
    for name in ("time", "approach", "separation"):
        one, other = (getattr(s.impacts, name) for s in (ups, downs))
        np.testing.assert_allclose(one, other, rtol=1e-9)
    for name in ("before", "after", "angle"):
        one, other = (getattr(s.impacts, name) for s in (ups, downs))
        np.testing.assert_allclose(one, -other, rtol=1e-9)


def test_each_stop_has_its_own_restitution():
    """All six parameters within 3.3 standard errors, and the fit has converged."""
    model = fitting.Model(Cart(), {"x": fitting.Sensor(0, noise=NOISE)})
    parameters = [
        fitting.Parameter(name, lambda m, n=name: getattr(m.system, n))
        for name in TRUTH
    ]
    parts = [cut(recording) for recording, _ in recorded(1)]
    found = fitting.fit(fitting.Problem.build(model, parts, parameters))
    assert found.converged, found.message
    for name, value in TRUTH.items():
        assert abs(found[name].value - value) < 3.3 * found[name].stderr, name
    assert found["stiffness"].stderr < 0.1
    one_law = eqx.tree_at(lambda m: m.system.r_right, model, jnp.asarray(0.78))
    held = fitting.fit(
        fitting.Problem.build(one_law, parts, parameters),
        free=[name for name in TRUTH if name != "r_right"],
    )
    assert not held.converged
    assert fitting.Doubt.POOR_FIT in [one.doubt for one in held.reasons]


def test_surfaces_that_make_no_sense_are_refused():
    recording = recorded(0)[0][0]
    with pytest.raises(ValueError, match="`upper` is not above"):
        segment(recording, "x", STATED_RIGHT, upper=STATED_LEFT)
    with pytest.raises(ValueError, match="one number, or one for each sample"):
        segment(recording, "x", np.zeros(3))
