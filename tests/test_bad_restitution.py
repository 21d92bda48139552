"""Restitution outside of [0, 1] and complex states are refused by every entry point."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import continuation
import jaxcam
from jaxcam import hybrid, maps, models, timestepping
from variational import lyapunov_spectrum, orbit_of


class Table(jaxcam.HybridSystem):
    """A ball above a moving table; no `check` of its own."""

    r: float = 0.7

    def vector_field(self, t, state):
        del t
        return jnp.stack([state[1], -9.81 * jnp.ones_like(state[1])])

    def gap(self, t, state):
        return state[0] - 0.01 * jnp.sin(30 * t)

    def impact(self, t, state):
        table = 0.3 * jnp.cos(30 * t)
        return jnp.stack([state[0], table - self.r * (state[1] - table)])

    @property
    def period(self):
        return jnp.asarray(2 * jnp.pi / 30)


class Bumper(Table):
    """A table that hits back harder."""

    active: ClassVar[bool] = True


STATE = np.array([0.5, 0.0])
ENTRIES = {
    "simulate": lambda s, x: jaxcam.simulate(s, x, 0.0, 0.5),
    "diffeqsolve": lambda s, x: jaxcam.simulate(s, x, 0.0, 0.5, engine="diffeqsolve"),
    "flow": lambda s, x: hybrid.flow(s, jnp.asarray(x), 0.0, 0.5),
    "stroboscope": lambda s, x: hybrid.stroboscope(s, x, 3),
    "periodic_orbit": lambda s, x: continuation.periodic_orbit(s, x),
    "orbit_of": lambda s, x: orbit_of(s, x),
    "lyapunov_spectrum": lambda s, x: lyapunov_spectrum(s, x, 64),
    "moreau": lambda s, x: timestepping.moreau(s, x, 0.0, 0.5, 64),
}


@pytest.mark.parametrize("r", [-0.5, 1.5])
@pytest.mark.parametrize("name", sorted(ENTRIES))
def test_restitution_of_a_system_of_ones_own(name, r):
    with pytest.raises(ValueError, match="restitution between 0 and 1; it is") as told:
        ENTRIES[name](Table(r), STATE)
    assert f"it is {r:g}" in str(told.value)


@pytest.mark.parametrize("r", [-0.5, 1.5])
@pytest.mark.parametrize(
    "make",
    [
        lambda r: models.BouncingBall(restitution=r),
        lambda r: models.ImpactOscillator(restitution=r),
        lambda r: models.TripleIntegrator(restitution=r),
        lambda r: models.CamFollower(restitution=models.ConstantRestitution(r)),
    ],
)
def test_restitution_of_a_model(make, r):
    with pytest.raises(ValueError, match="restitution between 0 and 1; it is"):
        make(r).check()


def test_restitution_of_one_lane_among_many():
    with pytest.raises(ValueError, match=r"it is 1\.5 in trajectory 1\."):
        hybrid.stroboscope(Table(), STATE, 3, where=lambda s: s.r, values=[0.5, 1.5])


@pytest.mark.parametrize("r", [0.0, 1.0])
def test_the_ends_of_the_range_are_let_through(r):
    assert bool(jaxcam.simulate(Table(r), STATE, 0.0, 0.1).successful)


def test_an_active_wall_may_give_speed_but_not_keep_the_direction():
    run = jaxcam.simulate(Bumper(1.5), STATE, 0.0, 0.4)
    before, after = run.impacts.speed_before, run.impacts.speed_after
    assert float(after[0]) == pytest.approx(1.5 * abs(float(before[0])), rel=1e-9)
    with pytest.raises(ValueError, match="it is -0.5"):
        jaxcam.simulate(Bumper(-0.5), STATE, 0.0, 0.4)


@pytest.mark.parametrize("name", sorted(ENTRIES))
@pytest.mark.usefixtures("unchecked_types")
def test_complex_states(name):
    with pytest.raises(ValueError, match="is complex; give real numbers"):
        ENTRIES[name](Table(), STATE + 1j)


@pytest.mark.usefixtures("unchecked_types")
def test_complex_numbers_elsewhere():
    tries = [
        lambda: jax.jit(lambda x: hybrid.flow(Table(), x, 0.0, 0.1).state)(STATE + 0j),
        lambda: hybrid.simulate(models.BeltOscillator(), STATE + 0j, 0.0, 1),
        lambda: maps.iterate(lambda x: x / 2, 0.3j, 4),
        lambda: models.BouncingBall(restitution=0.5j),
        lambda: continuation.branch(
            continuation.Equations(lambda u, p: u - p["a"], {"a": 0.0}),
            np.array([0j]),
            lambda p: p["a"],
            (0.0, 1.0),
        ),
    ]
    for attempt in tries:
        with pytest.raises(ValueError, match="is complex; give real numbers"):
            attempt()
