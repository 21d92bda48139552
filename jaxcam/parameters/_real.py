"""Convert input numbers to real arrays."""

import jax
import jax.numpy as jnp


def real_array(values, name: str = "state") -> jax.Array:
    """Convert numbers to an array of 64-bit floats.

    Args:
        values: Numbers.
        name: Name of the argument, for the error message.

    Returns:
        A real array.

    Raises:
        ValueError: The numbers are complex, so their imaginary parts would be lost.

    Examples:
        >>> from jaxcam.parameters import real_array
        >>> real_array([1, 2]).dtype.name
        'float64'
    """
    if any(jnp.iscomplexobj(leaf) for leaf in jax.tree.leaves(values)):
        raise ValueError(
            f"{name} is complex; give real numbers, with the real and imaginary parts "
            "as two components if both are needed"
        )
    return jnp.asarray(values, dtype=jnp.float64)
