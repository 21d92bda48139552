"""A linear system under ideal relay feedback."""

import jax
import jax.numpy as jnp

from ..filippov import FilippovSystem
from ._parameters import parameter, require_finite


class RelayFeedback(FilippovSystem):
    """Linear system with relay feedback: `x' = A x - b sgn(c x)`, for any number of
    states.

    Raises:
        ValueError: The shapes are inconsistent.

    Examples:
        >>> from jaxcam.models import RelayFeedback
        >>> b, c = np.array([0.0, 1.0]), np.array([1.0, 0.0])
        >>> relay = RelayFeedback(-np.eye(2), b, c)
        >>> relay.above(0.0, jnp.array([1.0, 0.0])).tolist()
        [-1.0, -1.0]
    """

    matrix: jax.Array = parameter()
    """The matrix A, shape `(n, n)`."""
    input: jax.Array = parameter()
    """The vector b, shape `(n,)`."""
    output: jax.Array = parameter()
    """The vector c, shape `(n,)`."""

    def __check_init__(self):
        n = self.input.shape[0] if self.input.ndim == 1 else -1
        if self.matrix.shape != (n, n) or self.output.shape != (n,):
            raise ValueError(
                "Give a matrix (n, n) and vectors (n,): their shapes are "
                f"{self.matrix.shape}, {self.input.shape} and {self.output.shape}."
            )

    def above(self, t, state) -> jax.Array:
        """Return the rates while the relay output is -1."""
        del t
        return self.matrix @ state - self.input

    def below(self, t, state) -> jax.Array:
        """Return the rates while the relay output is 1."""
        del t
        return self.matrix @ state + self.input

    def switching(self, t, state) -> jax.Array:
        """Return the output c x."""
        del t
        return jnp.sum(self.output * state)

    def check(self) -> None:
        """Raise `ValueError` for a matrix or vector that is not finite."""
        require_finite(matrix=self.matrix, input=self.input, output=self.output)
