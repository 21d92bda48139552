"""Find parameters that affect samples other than through motion and calibration."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from ...hybrid.caches import Cache
from ...hybrid.lowering import used_inputs
from ._each_record import kinds
from ._layout import Layout
from ._model import DriveState
from ._pieces import Pieces
from ._predict import Calibration, samples
from ._readings import Nodes


_KNOWN = Cache()


def shows_directly(layout: Layout, pieces: Pieces, columns, scales) -> bool:
    """Return whether one of the free parameters affects samples directly.

    Args:
        layout: The location of the parameters in the model.
        pieces: The pieces.
        columns: The free parameters, shape `(r, m)`.
        scales: Their scales; zero for padding, shape `(r, m)`.

    Returns:
        True if a sample depends on one of them at given nodes of the motion and a given
            calibration of the sensors.
    """
    free = set(np.asarray(columns)[np.asarray(scales) != 0].tolist())
    seen = seen_directly(layout, pieces) if free else ()
    return any(seen[k] for k in free)


def seen_directly(layout: Layout, pieces: Pieces) -> tuple[bool, ...]:
    """Return for each parameter whether a sample depends on it at given nodes of the
    motion and a given calibration of the sensors, as it does if the `error` of a sensor
    contains the parameter.
    """
    *_, n, m, c = pieces.flown.value.shape
    key = kinds((layout, n, m, c))
    return _KNOWN.get(key, lambda: _traced(layout, n, m, c))


def _traced(layout: Layout, n: int, m: int, c: int) -> tuple[bool, ...]:
    apart = dataclasses.replace(layout, ready=layout.apart or layout.ready)
    number, steps, each = jnp.zeros(()), jnp.zeros(n), jnp.zeros(c)
    nodes = Nodes(*(jnp.zeros((n, c)) for _ in Nodes._fields))
    sensing, along = Calibration(each, each, each), DriveState(steps, steps, steps)

    def seen(*values):
        model, place = apart.placed(values), jnp.zeros((n, m))
        return samples(model, nodes, sensing, number, number, place, (steps, along))

    values = np.zeros(len(layout.places))
    return tuple(used_inputs(jax.make_jaxpr(seen)(*values)))
