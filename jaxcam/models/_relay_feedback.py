"""A linear system under ideal relay feedback."""

import jax
import jax.numpy as jnp

from ..filippov import FilippovSystem
from ._parameters import parameter, require_finite


class RelayFeedback(FilippovSystem):
    """`x' = A x - b sgn(c x)`, for any number of states.

    **Arguments:** the matrix A, shape `(n, n)`, and the vectors b and c, shape `(n,)`.

    Raises:
        ValueError: Where the shapes do not fit.
    """

    matrix: jax.Array = parameter()
    input: jax.Array = parameter()
    output: jax.Array = parameter()

    def __check_init__(self):
        n = self.input.shape[0] if self.input.ndim == 1 else -1
        if self.matrix.shape != (n, n) or self.output.shape != (n,):
            raise ValueError(
                "Give a matrix (n, n) and vectors (n,): their shapes are "
                f"{self.matrix.shape}, {self.input.shape} and {self.output.shape}."
            )

    def above(self, t, state) -> jax.Array:
        """The relay gives -1."""
        del t
        return self.matrix @ state - self.input

    def below(self, t, state) -> jax.Array:
        """The relay gives 1."""
        del t
        return self.matrix @ state + self.input

    def switching(self, t, state) -> jax.Array:
        """The output c x."""
        del t
        return jnp.sum(self.output * state)

    def check(self) -> None:
        """Raise `ValueError` for a matrix or vector that is not finite."""
        require_finite(matrix=self.matrix, input=self.input, output=self.output)
