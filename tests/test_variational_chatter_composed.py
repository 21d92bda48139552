"""The composed map beside the motion itself, and the order of what it neglects.

It is linear in the distance mu from the interruption, and takes the acceleration near
release for linear in time. So its relative error is a sum of terms of order mu and of
order tau, the time of the last impacts from release; mu falls by q from one lobe to the
next and tau by p, so the order of the sum in mu lies between 1 and ln p / ln q =
kappa / 2, and tends to the latter. A term of the time tau* of D* stays, which lowers it
by at most a share tau* / tau.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcam
from jaxcam.hybrid import Settings
from jaxcam.models import ImpactOscillator
from variational import chatter_interruption, composed_map, lambda_inverse, scaling_law
from variational.chatter import simulated_by_parameter


# compiling takes most of the time
pytestmark = pytest.mark.slow

PHASE, RANK, LOBES = 0.35, 24, 16


def omega(system):
    return system.omega


@pytest.fixture(scope="module")
def critical():
    oscillator = ImpactOscillator(omega=jnp.asarray(1.0), restitution=jnp.asarray(0.5))
    return eqx.tree_at(
        omega, oscillator, chatter_interruption(oscillator, omega, (0.4, 0.8))
    )


@pytest.fixture(scope="module")
def composed(critical):
    return composed_map(critical, omega, RANK, phase=PHASE)


@pytest.fixture(scope="module")
def changes(composed):
    """The same place in successive lobes, farthest first."""
    r = composed.frame.restitution
    corner = lambda_inverse(lambda_inverse(3 / 8, r), r)
    inner = lambda_inverse(corner, r)
    bar, q = float(composed.lambda_bar), float(scaling_law(r).q)
    middle = np.sqrt((float(corner) - bar) * (float(inner) - bar))
    powers = np.arange(-20, LOBES - 20)
    return middle * q**powers / float(composed.incidence)


def left(composed, velocity, change):
    """What impacts leave of a velocity at the section, besides its drift."""
    return velocity - float(composed.relative[1]) - float(composed.drift[1]) * change


def test_error_is_of_the_order_of_what_is_neglected(critical, composed, changes):
    found = simulated_by_parameter(critical, omega, changes, phase=PHASE)
    exact = left(composed, np.asarray(found.velocity), changes)
    theory = left(
        composed, np.asarray(composed.along_parameter(changes))[:, 1], changes
    )
    error = np.abs(exact / theory - 1)
    law = scaling_law(composed.frame.restitution)
    print("mu", changes, "relative error", error)
    orders = np.diff(np.log(error)) / np.diff(np.log(changes))
    lowest = float(law.kappa) / 2
    stays = float(law.p) ** (RANK - np.asarray(found.impacts)[1:])
    assert np.all(orders > lowest * (1 - stays)) and np.all(orders < 1)
    assert abs(orders[7] / lowest - 1) < 0.005


def test_two_turns_beside_the_simulation(critical, composed, changes):
    law = scaling_law(composed.frame.restitution)
    moved, errors = changes[[0, 2, 4]], []
    hops = simulated_by_parameter(critical, omega, moved, phase=PHASE)
    for k, change in enumerate(moved):
        system = eqx.tree_at(omega, critical, critical.omega + change)
        period = float(system.period)
        times = [(PHASE + turn) * period for turn in (1, 2)]
        run = jaxcam.simulate(
            system, None, 0.0, times[1], settings=Settings(tolerance=1e-12)
        )
        once, twice = np.asarray(run.at(times))
        # impact by impact with gaps of their own: the same motion
        np.testing.assert_allclose(np.asarray(hops.state)[k], once, atol=1e-10)
        epsilon = composed(composed(0.0, change), change)
        want = float(epsilon) * float(composed.relative_vector[1])
        # the gap is 0 - x, so its velocity is minus that of the state
        got = float(left(composed, -twice[1], change))
        errors.append(abs(got / want - 1))
        print(f"mu {change:.2e}: motion {got:.4e}, map {want:.4e}")
    errors = np.array(errors)
    assert errors[0] < 0.2
    assert np.all(errors <= errors[0] * float(law.p) ** np.array([0, 2, 4]))
