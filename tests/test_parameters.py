"""Picking parameters by function and by name, and floats as arrays."""

import pickle

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.models import CamFollower
from jaxcam.parameters import as_arrays, parameter_names, pick, unit_tangent


class Inner(eqx.Module):
    radius: float = 2.0
    points: jax.Array = eqx.field(default_factory=lambda: jnp.zeros(3))


class Outer(eqx.Module):
    speed: float = 1.0
    inner: Inner = eqx.field(default_factory=Inner)
    terms: tuple = (Inner(5.0), Inner(6.0))
    count: int = 3
    on: bool = True


@pytest.mark.parametrize(
    "where, name, value",
    [
        (lambda s: s.speed, "speed", 1.0),
        ("speed", "speed", 1.0),
        ("inner.radius", "inner.radius", 2.0),
        (lambda s: s.terms[1].radius, "terms.1.radius", 6.0),
        ("terms[1].radius", "terms.1.radius", 6.0),
        ("terms.1.radius", "terms.1.radius", 6.0),
    ],
)
def test_a_function_and_a_name_pick_the_same_parameter(where, name, value):
    picked = pick(where, Outer())
    assert picked.names == (name,)
    assert picked(Outer()) == value
    moved = picked.replaced(Outer(), 9.0)
    assert picked(moved) == 9.0
    assert moved == eqx.tree_at(picked, Outer(), 9.0)


def test_several_parameters_come_as_a_tuple():
    picked = pick(("inner.radius", lambda s: s.speed), Outer())
    assert picked(Outer()) == (2.0, 1.0)
    assert picked.replaced(Outer(), 7.0, 8.0).speed == 8.0
    assert pick(lambda s: (s.speed, s.inner.radius), Outer()).names == (
        "speed",
        "inner.radius",
    )


def test_a_pick_travels_between_processes():
    picked = pick(lambda s: s.speed, CamFollower())
    assert pickle.loads(pickle.dumps(picked)) == picked
    assert len({picked, pick("speed", CamFollower())}) == 1


@pytest.mark.parametrize(
    "where, says",
    [
        (lambda s: s.sped, "does not exist"),
        ("sped", "there is no parameter 'sped'"),
        (lambda s: s.speed + 1, "does not exist"),
        (lambda s: 1.0, "as they are"),
        ("inner.points", "inner.points is not one number"),
        ("count", "count is not one number"),
        ("on", "on is not one number"),
        ((lambda s: (s.speed, s.inner.radius), "speed"), "selects several"),
    ],
)
def test_what_is_no_parameter_is_refused_with_the_names_of_those_that_are(where, says):
    with pytest.raises(ValueError, match="inner.radius|selects several") as caught:
        pick(where, Outer())
    assert says in str(caught.value)


def test_a_unit_tangent_moves_one_parameter():
    """d/dspeed of speed^2 + 3 radius is 2 speed."""
    system = as_arrays(Outer())
    along = unit_tangent("speed", system)

    def value(s):
        return s.speed**2 + 3 * s.inner.radius

    assert eqx.filter_jvp(value, (system,), (along,))[1] == 2.0
    same = unit_tangent(pick("speed", system), system)
    assert eqx.filter_jvp(value, (system,), (same,))[1] == 2.0


def test_integers_vary_only_where_they_may():
    assert pick("count", Outer(), integers=True)(Outer()) == 3
    assert "count" not in parameter_names(Outer())
    assert "count" in parameter_names(Outer(), integers=True)
    with pytest.raises(ValueError, match="on is not one number"):
        pick("on", Outer(), integers=True)


def test_floats_become_arrays_and_nothing_else_does():
    tree = {"a": 1.0, "b": np.float32(2.0), "c": 3, "d": True, "e": np.ones(2)}
    made = as_arrays(tree)
    assert isinstance(made["a"], jax.Array) and made["a"].dtype == jnp.float64
    assert isinstance(made["b"], jax.Array) and made["b"].dtype == jnp.float64
    assert made["c"] is tree["c"] and made["d"] is True and made["e"] is tree["e"]
