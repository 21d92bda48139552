"""Find samples that are certainly in contact from the acceleration, without a known
surface.

In flight, the follower has the acceleration due to its spring, which is known within
the tolerances of the rig file. If the motion is smooth and has a larger acceleration,
the follower is on the cam; at impacts, the motion is not smooth. If the spring force is
small, the test is inconclusive.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ...hybrid.programs import program
from .._recording import Recording
from .._rig import Rig
from ._contact_stretches import stretches
from ._hidden_hops import moved


# Half-width of the window over which acceleration is measured, and minimum duration of
# a contact (s)
_HALF, _LASTS = 0.0125, 0.04
# Margins above the free acceleration, in standard errors due to the noise and in
# standard deviations due to the tolerances
_BEYOND, _SPREAD = 4.0, 3.0
# A window is smooth if its sum of squared residuals exceeds that expected from noise by
# less than this many standard deviations
_SMOOTH = 4.0
# Number of positions at which the free acceleration is tabulated
_PLACES = 64


def firm_contact(
    recording: Recording, rig: Rig, speed: float, channel: str, noise: float
) -> Bool[np.ndarray, " k"]:
    """Return the samples of a recording that are certainly on the cam.

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
        # omit the beginning of a contact, because flights in it may be too low to be
        # observed
        if (last - first) * recording.interval >= _LASTS:
            firm[first + half : last] = True
    return firm


def _most(rig: Rig, speed: float, positions) -> Float[np.ndarray, " k"]:
    """Return the largest acceleration of a free follower within the tolerances."""
    places = np.linspace(positions.min(), positions.max(), _PLACES)
    nominal = _free(rig, speed, places)
    change = [_free(one, speed, places) - nominal for one in moved(rig)]
    spread = np.sqrt(np.sum(np.square(change), axis=0))
    return np.interp(positions, places, nominal + _SPREAD * spread)


def _free(rig: Rig, speed: float, places) -> Float[np.ndarray, " places"]:
    return np.asarray(_accelerations(rig.system(speed), jnp.asarray(places)))


@program
def _accelerations(system, places):
    def one(place):
        state = jnp.stack([place, jnp.zeros_like(place)])
        return system.vector_field(jnp.zeros(()), state)[1]

    return jax.vmap(one)(places)
