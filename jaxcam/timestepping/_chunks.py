"""Run steps in chunks of equal length, so that only one program is compiled."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


CHUNK = 1024
"""Number of steps in a chunk."""


def in_chunks(
    run: Callable[[Any, Any], tuple[Any, Any]],
    carry,
    steps: int,
    progress: Callable[[float], None] | None = None,
):
    """Return the outputs of `steps` steps; `run(carry, k)` runs a chunk starting at
    step k.

    `progress` is called with the fraction of steps completed.
    """
    parts = []
    for first in range(0, steps, CHUNK):
        carry, found = run(carry, jnp.asarray(float(first)))
        keep = min(CHUNK, steps - first)
        parts.append(jax.tree.map(lambda leaf: np.asarray(leaf)[:keep], found))
        if progress is not None:
            progress((first + keep) / steps)
    return jax.tree.map(lambda *leaves: jnp.asarray(np.concatenate(leaves)), *parts)
