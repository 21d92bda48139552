"""The forced linear oscillator, with its motion in closed form."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._parameters import parameter


class ForcedOscillator(eqx.Module):
    """`u'' + 2 damping u' + stiffness u = amplitude cos(omega t)` (thesis, eq. 2.4).

    On the cylinder: the state is (u, u', time in the period), and the last component
    closes after 2 pi / omega. (The thesis writes cos(x3) in thesis eq. 2.5, which fits
    omega = 1.)
    """

    damping: jax.Array = parameter(0.05)
    stiffness: jax.Array = parameter(1.0)
    amplitude: jax.Array = parameter(1.0)
    omega: jax.Array = parameter(1.3)

    @property
    def period(self) -> jax.Array:
        """Period of the forcing."""
        return 2 * jnp.pi / self.omega

    def vector_field(self, state: Float[Array, " 3"]) -> Float[Array, " 3"]:
        """Rate of change on the cylinder (thesis, eq. 2.5)."""
        u, velocity, time = state
        force = self.amplitude * jnp.cos(self.omega * time)
        acceleration = force - self.stiffness * u - 2 * self.damping * velocity
        return jnp.stack([velocity, acceleration, jnp.ones_like(time)])

    def steady(self, time) -> Float[Array, " 2"]:
        """Position and velocity of the periodic motion at a time."""
        real = self.stiffness - self.omega**2
        imaginary = 2 * self.damping * self.omega
        factor = self.amplitude / (real**2 + imaginary**2)
        cosine, sine = jnp.cos(self.omega * time), jnp.sin(self.omega * time)
        return factor * jnp.stack(
            [
                real * cosine + imaginary * sine,
                self.omega * (imaginary * cosine - real * sine),
            ]
        )

    def propagator(self, duration) -> Float[Array, "2 2"]:
        """What becomes of a deviation from the periodic motion after `duration`."""
        matrix = jnp.array([[0.0, 1.0], [0.0, 0.0]])
        matrix = matrix.at[1].set(jnp.stack([-self.stiffness, -2 * self.damping]))
        return jax.scipy.linalg.expm(matrix * duration)

    def solution(self, time, state: Float[Array, " 3"]) -> Float[Array, " 3"]:
        """The state a duration `time` after `state`, exact."""
        start = state[2]
        moved = self.propagator(time) @ (state[:2] - self.steady(start))
        end = start + time
        return jnp.append(moved + self.steady(end), jnp.mod(end, self.period))

    def poincare_map(self, point: Float[Array, " 2"]) -> Float[Array, " 2"]:
        """Position and velocity one period after time zero."""
        zero = jnp.zeros(())
        return self.solution(self.period, jnp.append(point, zero))[:2]
