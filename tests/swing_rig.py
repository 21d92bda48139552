"""A damped mass on a spring, far from any stop, for tests of the diagnosis."""

import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

from jaxcam import HybridSystem
from jaxcam.discrepancy.search._of_base import within
from jaxcam.discrepancy.terms import WithTerms
from jaxcam.fitting import Model, Parameter, Problem, Sensor
from jaxcam.recordings import Recording, segment


class Swing(HybridSystem):
    """A damped mass on a spring, far from any stop."""

    stiffness: float = 149.0
    damping: float = 0.1

    def vector_field(self, t, state):
        force = self.stiffness * state[0] + self.damping * state[1]
        return jnp.stack([state[1], -force])

    def gap(self, t, state):
        return state[0] + 100.0

    def impact(self, t, state):
        return state * jnp.array([1.0, -0.5])


PARAMETERS = (
    Parameter("stiffness", lambda m: m.system.stiffness, 3.0, unit="1/s^2"),
    Parameter("damping", lambda m: m.system.damping, 0.05, unit="1/s"),
)


def swinging(force, starts, seconds: float, noise: float) -> Problem:
    """Recordings of a swing with an additional `force(position, velocity)`, released
    from rest, and the model without that force."""
    time = 1e-3 * np.arange(round(1000 * seconds))

    def rate(t, x):
        return x[1], -149.0 * x[0] - 0.1 * x[1] + force(*x)

    rng, recordings = np.random.default_rng(3), []
    for number, start in enumerate(starts):
        flown = solve_ivp(
            rate, (0.0, seconds), (start, 0.0), "DOP853", time, rtol=1e-10, atol=1e-12
        )
        seen = flown.y[0] + noise * rng.normal(size=len(time))
        run = Recording(f"run{number}", time, {"angle_rad": seen})
        recordings.append(segment(run, "angle_rad", noise=noise))
    model = Model(WithTerms(Swing()), {"angle_rad": Sensor(0, noise=noise)})
    return Problem.build(model, recordings, [within(one) for one in PARAMETERS])
