"""The state from which a system of a user starts if none is given."""

import numpy as np

from ..hybrid import HybridSystem
from ._source import Source


def natural_start(
    model: HybridSystem, source: Source, t0: float = 0.0
) -> tuple[np.ndarray | None, str]:
    """Return a start, and a sentence that states it: the one in the rig file, or rest.

    The start is None, and the sentence is empty, if the rig file gives none and the
    system has a release point in sustained contact or is unknown.
    """
    import jax.numpy as jnp

    import jaxcam

    from ..hybrid.surface import rest_state

    found, words = source.start(), "as the rig file states"
    names = model.state_names
    if found is None and names:
        try:
            # a system with a release point starts there
            jaxcam.simulate(model, None, t0, t0)
        except ValueError:
            found, words = rest_state(model, jnp.asarray(t0), len(names)), "at rest"
    if found is None:
        return None, ""
    numbers = (f"{value + 0.0:.6g}" for value in found)
    units = model.state_units or ("",) * len(found)
    known = names or tuple(f"x{k + 1}" for k in range(len(found)))
    parts = (
        f"{name} {number} {'' if unit == '-' else unit}".strip()
        for name, number, unit in zip(known, numbers, units, strict=True)
    )
    return found, f"Start {words}: {', '.join(parts)}."
