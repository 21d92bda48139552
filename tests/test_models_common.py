"""What every model owes: parameters as leaves, derivatives, batches, checks."""

import equinox as eqx
import jax
import jax.flatten_util
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.models import (
    BouncingBall,
    CamFollower,
    ImpactOscillator,
    PowerLawRestitution,
    TripleIntegrator,
)


SYSTEMS = [
    CamFollower(),
    CamFollower(restitution=PowerLawRestitution(0.55, 0.3, 0.2)).prepared(),
    ImpactOscillator(omega=2.8, restitution=0.8, wall=0.1, damping=0.05),
    BouncingBall(gravity=9.81, restitution=0.7, amplitude=0.02, frequency=20.0),
    TripleIntegrator(restitution=0.6),
]
IDS = ["cam", "cam-prepared", "oscillator", "ball", "triple"]


def state_of(system):
    return jnp.array([0.3, -0.7, -1.1])[: len(system.state_names)]


def everything(system, t, state):
    """Field, gap and impact in one vector."""
    return jnp.concatenate(
        [
            system.vector_field(t, state),
            jnp.atleast_1d(system.gap(t, state)),
            system.impact(t, state),
        ]
    )


@pytest.mark.parametrize("system", SYSTEMS, ids=IDS)
def test_every_leaf_is_a_parameter_in_double_precision(system):
    assert len(system.state_names) == len(system.state_units)
    leaves = jax.tree.leaves(system)
    assert leaves
    assert all(leaf.dtype == jnp.float64 for leaf in leaves)
    assert everything(system, 0.3, state_of(system)).dtype == jnp.float64


@pytest.mark.parametrize("system", SYSTEMS, ids=IDS)
def test_derivative_in_every_parameter(system):
    t, state = jnp.asarray(0.3), state_of(system)
    flat, unravel = jax.flatten_util.ravel_pytree(system)

    @jax.jit
    def function(parameters):
        return everything(unravel(parameters), t, state)

    forward = jax.jit(jax.jacfwd(function))(flat)
    reverse = jax.jit(jax.jacrev(function))(flat)
    steps = 1e-6 * np.maximum(np.abs(flat), 0.01)
    moved = np.stack([function(flat + d) for d in np.diag(steps)], axis=1)
    back = np.stack([function(flat - d) for d in np.diag(steps)], axis=1)
    differences = (moved - back) / (2 * steps)
    scale = 1 + np.max(np.abs(forward))
    assert np.max(np.abs(forward - reverse)) < 1e-13 * scale
    # central differences with this step carry about 1e-8
    assert np.max(np.abs(forward - differences)) < 1e-7 * scale


@pytest.mark.parametrize("system", SYSTEMS, ids=IDS)
def test_impact_reverses_the_normal_velocity(system):
    t, state = jnp.asarray(0.3), state_of(system)

    def normal_velocity(x):
        field = system.vector_field(t, x)
        return jax.jvp(system.gap, (t, x), (jnp.ones_like(t), field))[1]

    after = system.impact(t, state)
    before = normal_velocity(state)
    if isinstance(system, CamFollower):
        r = system.restitution(system.speed, jnp.abs(before))
    else:
        r = system.restitution
    assert abs(normal_velocity(after) + r * before) < 1e-14
    assert system.gap(t, after) == system.gap(t, state)


@pytest.mark.parametrize("system", SYSTEMS, ids=IDS)
def test_batches_of_parameters(system):
    batch = jax.tree.map(lambda x: jnp.stack([x, 1.01 * x]), system)
    t, state = jnp.asarray(0.3), state_of(system)
    together = jax.jit(jax.vmap(everything, in_axes=(0, None, None)))(batch, t, state)
    for k in range(2):
        alone = everything(jax.tree.map(lambda x, k=k: x[k], batch), t, state)
        # fused arithmetic rounds differently
        assert np.max(np.abs(together[k] - alone)) < 1e-13 * (1 + np.max(np.abs(alone)))


def test_models_can_be_made_inside_a_transformation():
    def field(gravity):
        ball = BouncingBall(gravity=gravity)
        return ball.vector_field(0.0, jnp.array([1.0, 0.0]))[1]

    assert jax.grad(field)(9.81) == -1.0
    assert eqx.tree_equal(
        eqx.filter_jit(lambda: ImpactOscillator(omega=2))(), ImpactOscillator(omega=2)
    )


def test_impact_oscillator_is_its_equation():
    system = ImpactOscillator(omega=2.8, restitution=0.8, wall=0.2, damping=0.1)
    x, v, t = 0.15, -0.4, 0.6
    acceleration = np.cos(2.8 * t) - x - 2 * 0.1 * v
    found = system.vector_field(t, jnp.array([x, v]))
    assert np.max(np.abs(found - np.array([v, acceleration]))) < 1e-15
    assert abs(system.gap(t, jnp.array([x, v])) - 0.05) < 1e-16
    assert abs(system.period - 2 * np.pi / 2.8) < 1e-15


def test_bouncing_ball_on_its_floor():
    system = BouncingBall(amplitude=0.02, frequency=20.0)
    t = 0.1
    state = jnp.array([0.02 * np.sin(2.0), -1.0])
    assert abs(system.gap(t, state)) < 1e-17  # m
    floor = 0.4 * np.cos(2.0)
    # m/s: relative to the floor -0.8 times the approach
    expected = floor - 0.8 * (-1.0 - floor)
    assert abs(system.impact(t, state)[1] - expected) < 1e-15
    assert abs(system.period - 2 * np.pi / 20.0) < 1e-15


def test_triple_integrator_is_equations_6_22_to_6_24():
    system = TripleIntegrator(restitution=0.5)
    state = jnp.array([0.0, -0.3, -1.0])
    field = system.vector_field(0.0, state)
    assert jnp.array_equal(field, jnp.array([-0.3, -1.0, 1.0]))
    assert jnp.array_equal(system.impact(0.0, state), jnp.array([0.0, 0.15, -1.0]))
    assert system.period is None


@pytest.mark.parametrize(
    "system, message",
    [
        (ImpactOscillator(omega=0.0), "`omega`"),
        (ImpactOscillator(restitution=-0.1), "between 0 and 1"),
        (ImpactOscillator(wall=np.nan), "`wall`"),
        (ImpactOscillator(damping=-0.1), "`damping`"),
        (BouncingBall(gravity=0.0), "`gravity`"),
        (BouncingBall(restitution=1.1), "between 0 and 1"),
        (BouncingBall(amplitude=np.inf), "`amplitude`"),
        (BouncingBall(frequency=-1.0), "`frequency`"),
        (TripleIntegrator(restitution=2.0), "between 0 and 1"),
    ],
)
def test_meaningless_parameters(system, message):
    with pytest.raises(ValueError, match=message):
        system.check()


@pytest.mark.parametrize("system", SYSTEMS, ids=IDS)
def test_meaningful_parameters_pass(system):
    system.check()
