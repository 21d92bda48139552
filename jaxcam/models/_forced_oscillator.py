"""The forced linear oscillator, with its motion in closed form."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._parameters import parameter


class ForcedOscillator(eqx.Module):
    """Forced linear oscillator without impacts, with its solution in closed form.

    `u'' + 2 damping u' + stiffness u = amplitude cos(omega t)` (thesis, eq. 2.4), on
    the cylinder: the state is (u, u', time within the period), and the last component
    has the period 2 pi / omega. (The thesis has cos(x3) in its eq. 2.5, which is valid
    for omega = 1.)

    Examples:
        >>> from jaxcam.models import ForcedOscillator
        >>> system = ForcedOscillator(omega=2.0)
        >>> round(float(system.period), 6)
        3.141593
    """

    damping: jax.Array = parameter(0.05)
    """Half of the damping coefficient."""
    stiffness: jax.Array = parameter(1.0)
    """Square of the natural frequency."""
    amplitude: jax.Array = parameter(1.0)
    """Amplitude of the forcing."""
    omega: jax.Array = parameter(1.3)
    """Angular frequency of the forcing."""

    @property
    def period(self) -> jax.Array:
        """Period of the forcing."""
        return 2 * jnp.pi / self.omega

    def vector_field(self, state: Float[Array, " 3"]) -> Float[Array, " 3"]:
        """Return the rates of change on the cylinder, `(3,)` (thesis, eq. 2.5)."""
        u, velocity, time = state
        force = self.amplitude * jnp.cos(self.omega * time)
        acceleration = force - self.stiffness * u - 2 * self.damping * velocity
        return jnp.stack([velocity, acceleration, jnp.ones_like(time)])

    def steady(self, time) -> Float[Array, " 2"]:
        """Return the position and velocity of the periodic motion at a given time,
        shape `(2,)`.
        """
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
        """Return the matrix that maps a perturbation of the periodic motion over
        `duration`.
        """
        matrix = jnp.array([[0.0, 1.0], [0.0, 0.0]])
        matrix = matrix.at[1].set(jnp.stack([-self.stiffness, -2 * self.damping]))
        return jax.scipy.linalg.expm(matrix * duration)

    def solution(self, time, state: Float[Array, " 3"]) -> Float[Array, " 3"]:
        """Return the exact state reached after `time` from `state`, shape `(3,)`.

        Examples:
            >>> from jaxcam.models import ForcedOscillator
            >>> system = ForcedOscillator()
            >>> start = jnp.append(system.steady(0.0), 0.0)
            >>> end = system.solution(system.period, start)
            >>> np.allclose(end[:2], start[:2])  # the periodic motion
            True
        """
        start = state[2]
        moved = self.propagator(time) @ (state[:2] - self.steady(start))
        end = start + time
        return jnp.append(moved + self.steady(end), jnp.mod(end, self.period))

    def poincare_map(self, point: Float[Array, " 2"]) -> Float[Array, " 2"]:
        """Return the position and velocity one period after time zero, shape `(2,)`."""
        zero = jnp.zeros(())
        return self.solution(self.period, jnp.append(point, zero))[:2]
