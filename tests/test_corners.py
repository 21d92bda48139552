"""Corners of the functions of a system are found with their lines."""

import inspect

import jax
import jax.numpy as jnp
import pytest

import jaxcam
from jaxcam.hybrid import corners
from jaxcam.models import BilinearOscillator, BouncingBall, ImpactOscillator


class Ball(BouncingBall):
    """A ball with one more force."""

    def vector_field(self, t, state):
        return jnp.stack([state[1], self.force(t, state) - self.gravity])


def _line(function) -> int:
    """The line below the head of a function."""
    return inspect.getsourcelines(function)[1] + 1


CASES = {
    "abs": lambda t, x: jnp.abs(x[1]),
    "sign": lambda t, x: jnp.sign(x[1]),
    "maximum": lambda t, x: jnp.maximum(x[0], 0.1),
    "minimum": lambda t, x: jnp.minimum(x[0], 0.1),
    "clip": lambda t, x: jnp.clip(x[0], 0.0, 1.0),
    "where": lambda t, x: jnp.where(x[0] > 0, 1.0, 2.0),
    "floor": lambda t, x: jnp.floor(t),
    "remainder": lambda t, x: jnp.mod(t, 1.0),
}


@pytest.mark.parametrize("name", CASES)
def test_each_operation_is_found(name):
    class One(Ball):
        def force(self, t, state):
            return CASES[name](t, state)

    found = corners(One(), [1.0, 0.0])
    assert {corner.operation for corner in found} >= {name}
    assert {corner.function for corner in found} == {"vector_field"}
    said = str(found[0])
    assert "test_corners.py" in said and "SwitchedSystem" in said


def test_lines_are_those_of_the_user_also_inside_compiled_functions():
    @jax.jit
    def spring(x):
        return jnp.where(x > 0, 4.0 * x, x)

    class Two(Ball):
        def force(self, t, state):
            return spring(state[0]) + jnp.where(t > 1, 1.0, 0.0)

    found = {corner.line for corner in corners(Two(), [1.0, 0.0])}
    inner = inspect.getsourcelines(Two.force)[1] + 1
    assert inner in found and len(found) == 2


def test_what_does_not_depend_on_the_motion_is_no_corner():
    class Parameter(Ball):
        def force(self, t, state):
            return jnp.where(self.gravity > 0, jnp.abs(self.gravity), 0.0) * state[0]

    class ByNumber(Ball):
        def force(self, t, state):
            return (state[1] > 0).astype(float) * 0.5

    assert corners(Parameter(), [1.0, 0.0]) == []
    assert [c.operation for c in corners(ByNumber(), [1.0, 0.0])] == ["where"]
    assert corners(ImpactOscillator(), [0.0, 0.0]) == []
    assert corners(BilinearOscillator(), [0.0, 0.0]) == []


@pytest.mark.parametrize(
    ("force", "count"),
    [
        (lambda self, v: 0.3 * v * jnp.abs(v), 0),
        (lambda self, v: self.gravity * jnp.abs(v) * v, 0),
        (lambda self, v: -v * jnp.abs(v), 0),
        (lambda self, v: -jnp.abs(v) * v, 0),
        (lambda self, v: jnp.abs(v) / self.gravity * v, 0),
        (lambda self, v: v / self.gravity * jnp.abs(v), 0),
        (lambda self, v: (v - 1.0) * jnp.abs(v - 1.0), 0),
        (lambda self, v: v * (jnp.abs(v) / v), 1),
        (lambda self, v: v * (1.0 / jnp.abs(v)), 1),
        (lambda self, v: (v - 2.0) * jnp.abs(v - 1.0), 1),
        (lambda self, v: jnp.abs(v) * v + jnp.abs(v), 1),
        (lambda self, v: jnp.abs(v) * self.gravity, 1),
        (lambda self, v: jnp.abs(v) ** 2, 1),
    ],
)
def test_quadratic_drag_is_no_corner(force, count):
    class Drag(Ball):
        def force(self, t, state):
            return force(self, state[1])

    assert len(corners(Drag(), [1.0, 0.0])) == count


def test_a_switch_at_a_declared_time_is_no_corner():
    class Pulse(Ball):
        def force(self, t, state):
            return jnp.where(t < 0.5, 1.0, 0.0) + jnp.maximum(state[0], 0.1)

        @property
        def breakpoints(self):
            return jnp.array([0.5])

    assert [c.operation for c in corners(Pulse(), [1.0, 0.0])] == ["maximum"]


def test_a_corner_of_unknown_origin_names_no_line():
    assert str(jaxcam.hybrid.Corner("gap", "abs", "", 0)).startswith("`abs` in `gap`")
