"""Samples in certain contact, by the acceleration: no surface has to be known.

In flight it has the acceleration that its spring gives it, which the rig file states
within its tolerances. What is held up by more is on the cam, if it is smooth: impacts
are not. Where the spring hardly presses nothing can be said.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from .._recording import Recording
from .._rig import Rig
from ._contact_stretches import stretches
from ._hidden_hops import moved


# Half of the window in which an acceleration is measured, and the least time that a
# follower is to be held up for (s)
_HALF, _LASTS = 0.0125, 0.04
# Standard errors of the noise, and standard deviations of the tolerances, that count
_BEYOND, _SPREAD = 4.0, 3.0
# Standard deviations of what noise leaves of a window up to which it is smooth
_SMOOTH = 4.0
# Positions at which the free acceleration is tabulated
_PLACES = 64


def firm_contact(
    recording: Recording, rig: Rig, speed: float, channel: str, noise: float
) -> Bool[np.ndarray, " k"]:
    """Samples of a record that are on the cam beyond doubt.

    **Arguments:** `speed` of the cam (rad/s), for the rig's system; the channel of the
    follower and its noise.
    """
    samples = recording[channel]
    half = max(6, round(_HALF / recording.interval))
    found = np.zeros(len(samples), dtype=bool)
    if len(samples) < 4 * half:
        return found
    windows = np.lib.stride_tricks.sliding_window_view(samples, 2 * half + 1)
    place = np.linspace(-1.0, 1.0, 2 * half + 1)
    basis, _ = np.linalg.qr(place[:, None] ** np.arange(4))
    along = windows @ basis
    left = np.sum(windows**2, axis=1) - np.sum(along**2, axis=1)
    free = len(place) - 4
    smooth = left < noise**2 * (free + _SMOOTH * np.sqrt(2 * free))
    bend = 2 * np.linalg.pinv(place[:, None] ** np.arange(4))[2]
    scale = (half * recording.interval) ** -2
    held = scale * (windows @ bend)
    error = _BEYOND * scale * noise * np.linalg.norm(bend)
    most = _most(rig, speed, windows[:, half])
    found[half : len(samples) - half] = smooth & (held > most + error)
    firm = np.zeros(len(samples), dtype=bool)
    for first, last in stretches(found):
        # flights before it may be too low to be seen
        if (last - first) * recording.interval >= _LASTS:
            firm[first + half : last] = True
    return firm


def _most(rig: Rig, speed: float, positions) -> Float[np.ndarray, " k"]:
    """The largest acceleration of a free follower that the tolerances allow."""
    places = np.linspace(positions.min(), positions.max(), _PLACES)
    nominal = _free(rig, speed, places)
    change = [_free(one, speed, places) - nominal for one in moved(rig)]
    spread = np.sqrt(np.sum(np.square(change), axis=0))
    return np.interp(positions, places, nominal + _SPREAD * spread)


def _free(rig: Rig, speed: float, places) -> Float[np.ndarray, " places"]:
    return np.asarray(_accelerations(rig.system(speed), jnp.asarray(places)))


@eqx.filter_jit
def _accelerations(system, places):
    def one(place):
        state = jnp.stack([place, jnp.zeros_like(place)])
        return system.vector_field(jnp.zeros(()), state)[1]

    return jax.vmap(one)(places)
