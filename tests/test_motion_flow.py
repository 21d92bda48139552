"""`flow` ends where `simulate` does, with the same derivatives."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import jaxcam
from jaxcam.hybrid import flow
from jaxcam.hybrid.surface import release_point
from jaxcam.models import CamFollower


@eqx.filter_jit
def _end(system, state, t0, t1):
    return flow(system, state, t0, t1)


@eqx.filter_jit
def _slope(system, state, t0, t1):
    return jax.jacfwd(lambda t: flow(system, state, t0, t).state)(t1)


def test_flow_is_the_end_of_a_trajectory_with_chatter_and_release():
    """One turn from the release point, at 140 rpm: state to 1e-13, impacts counted."""
    system = CamFollower(speed=140 * 2 * np.pi / 60)
    start = release_point(system, 0.0)
    t0, t1 = start.time, start.time + 1.05 * system.period
    arrival = _end(system, start.state, t0, t1)
    trajectory = jaxcam.simulate(system, start.state, t0, t1)
    assert int(arrival.code) == 0
    assert int(arrival.impacts) == trajectory.impacts.count
    np.testing.assert_allclose(arrival.state, trajectory.at(t1[None])[0], atol=1e-13)
    # the flow moves with its end: the derivative is the vector field there
    rate = system.vector_field(t1, arrival.state)
    assert not bool(jnp.any(arrival.contact))
    np.testing.assert_allclose(_slope(system, start.state, t0, t1), rate, rtol=1e-9)
