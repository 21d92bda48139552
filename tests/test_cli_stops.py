"""Stops in a bifurcation diagram: constraints at a constant value of a coordinate."""

from typing import ClassVar

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest

import jaxcam
from jaxcam import sweeps
from jaxcam.cli._stops import constant_stops
from jaxcam.models import BouncingBall, CamFollower, ImpactOscillator
from jaxcam.plotting import sweep_diagram


class Stops(jaxcam.HybridSystem):
    constraint_names: ClassVar = ("left", "right", "shaken")

    width: float = 0.5
    amplitude: float = 0.1

    def vector_field(self, t, state):
        return jnp.stack([state[1], -state[0]])

    def gap(self, t, state):
        fixed = [2 * (self.width + state[0]), 1.0 - state[0]]
        return jnp.stack([*fixed, state[0] - self.amplitude * jnp.sin(t)])

    def impact(self, t, state):
        return jnp.tile(jnp.stack([state[0], -state[1]]), (3, 1))


def test_a_stop_has_a_constant_position():
    # a gap that depends on time is not a stop
    amplitudes = np.array([0.1, 0.3])
    found = constant_stops(Stops(), "amplitude", amplitudes, 2)
    assert found == {"left": -0.5, "right": 1.0}
    # nor is one that the parameter moves
    assert constant_stops(Stops(), "width", amplitudes, 2) == {"right": 1.0}
    # the velocity has no stop
    assert constant_stops(Stops(), "amplitude", amplitudes, 2, component=1) == {}


def test_stops_of_models():
    values = np.array([2.0, 3.0])
    oscillator = ImpactOscillator(wall=0.2)  # pyright: ignore
    (place,) = constant_stops(oscillator, "omega", values, 2).values()
    assert place == pytest.approx(0.2, rel=1e-12)
    assert constant_stops(CamFollower(), "speed", values, 2) == {}
    moving = BouncingBall(amplitude=0.1)  # pyright: ignore
    assert constant_stops(moving, "frequency", values, 2) == {}


def test_stops_near_the_samples_are_drawn_and_named():
    logistic = sweeps.Map(lambda x, p: p["mu"] * x * (1 - x), {"mu": 3.2})
    found = sweeps.diagram(logistic, "mu", [2.8, 3.2], [0.3], keep=16)
    figure = sweep_diagram(found, stops={"wall": 0.9, "far wall": 5.0})
    (axis,) = figure.axes
    assert [one.get_text() for one in axis.texts] == ["wall"]
    (line,) = axis.lines
    assert np.asarray(line.get_ydata()).tolist() == [0.9, 0.9]
    low, high = axis.get_ylim()
    assert low < 0.5 and 0.9 < high < 1.2
    plt.close(figure)
