"""Refuse recordings whose times cannot be seconds."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..recordings import Recording, RecordingError
from .engine import Model


def refuse_slow_samples(
    model: Model, recording: Recording, state: Float[np.ndarray, " n"]
) -> None:
    """Raise `RecordingError` if every oscillation of the model about a state takes less
    time than one sampling interval, as with times in milliseconds read as seconds.

    No recording can follow such a motion, but a fit would search for a long time.
    """

    def field(x):
        return model.system.vector_field(jnp.asarray(float(recording.time[0])), x)

    slopes = np.asarray(jax.jacfwd(field)(jnp.asarray(state)))
    if not np.all(np.isfinite(slopes)):
        return
    rates = np.abs(np.linalg.eigvals(slopes).imag)
    rates = rates[rates > 0]
    if not len(rates):
        return
    period = 2 * np.pi / float(np.min(rates))
    if period < recording.interval:
        raise RecordingError(
            f"{recording.name}: the samples are {recording.interval:.3g} s apart, but "
            f"an oscillation of the model takes only {period:.3g} s; check the unit of "
            f"the time column (`time_ms` if it is in milliseconds) and the parameters "
            f"of the model."
        )
