"""Keys of systems: two systems with the same key behave alike."""

import hashlib
from collections.abc import Hashable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ._system import HybridSystem


def structure_of(system: HybridSystem) -> Hashable | None:
    """Return a key of everything that determines the compiled programs of a system, or
    `None` if the key would not be hashable.
    """
    arrays, rest = eqx.partition(system, eqx.is_array)
    shapes = tuple((leaf.shape, leaf.dtype) for leaf in jax.tree.leaves(arrays))
    fixed, structure = jax.tree.flatten(rest)
    found = structure, tuple(fixed), shapes
    try:
        hash(found)
    except TypeError:
        return None
    return found


def digest_of(system: HybridSystem) -> bytes:
    """Return a hash of the values of all arrays of a system."""
    found = hashlib.blake2b(digest_size=16)
    for leaf in jax.tree.leaves(eqx.filter(system, eqx.is_array)):
        if jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key):
            leaf = jax.random.key_data(leaf)
        found.update(np.asarray(leaf).tobytes())
    return found.digest()
