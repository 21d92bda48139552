"""Simulate and analyse mechanical systems with impacts.

Define a system (vector field, gap and impact law), simulate it, and differentiate the
result. Importing this package turns on 64-bit floats in JAX.
"""

from importlib.metadata import version as _version

from ._xla_log import silence_xla as _silence_xla


_silence_xla()

import jax as _jax


# before any array is created below
_jax.config.update("jax_enable_x64", True)

from ._citation import citation as citation
from .hybrid import (
    clear_caches as clear_caches,
    HybridSystem as HybridSystem,
    Settings as Settings,
    simulate as simulate,
    Trajectory as Trajectory,
)


__version__ = _version("jaxcam")
