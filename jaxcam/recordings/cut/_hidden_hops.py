"""Find flights that are too low for the encoder to resolve.

Just above the valve-float speed, the follower lifts by a few times the noise once per
turn. Samples of such a flight resemble contact. The rig file determines, within its
tolerances, the phases of small contact force at which such flights are possible.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ...hybrid.programs import program
from ...hybrid.surface import contact_acceleration
from .._drive import Drive
from .._rig import Quantity, Rig
from ._contact_stretches import stretches


# Number of phases per turn
_GRID = 720
# Margin for the tolerances of the rig, in standard deviations
_SPREAD = 3.0
# Largest angle (rad) by which the phase of a release may precede that of the others
_EARLY = 0.1


def hop_phases(rig: Rig, speed: float) -> Bool[np.ndarray, " 720"]:
    """Return the phases, out of 720 per turn, at which a hidden flight is possible.

    They extend from the phase at which the contact acceleration, minus three standard
    deviations due to the tolerances, allows a release, to the phase at which the
    chatter after the flight has ended.

    **Arguments:** `speed` of the cam (rad/s). Phase zero is that of the nominal cam.
    """
    nominal = _pull(rig, speed)
    change = [_pull(moved, speed) - nominal for moved in moved(rig)]
    pull = nominal + _SPREAD * np.sqrt(np.sum(np.square(change), axis=0))
    if not np.any(pull > 0):
        return np.zeros(_GRID, dtype=bool)
    if not np.any(pull < 0):
        return np.ones(_GRID, dtype=bool)
    restitution = min(rig.restitution.value + rig.restitution.tolerance, 0.99)
    found = np.zeros(_GRID, dtype=bool)
    step = 2 * np.pi / speed / _GRID
    for first in np.flatnonzero((pull > 0) & (np.roll(pull, 1) <= 0)):
        length = _hop(np.roll(pull, -first), step, restitution)
        found[(first + np.arange(length)) % _GRID] = True
    return found


def _hop(pull: np.ndarray, step: float, restitution: float) -> int:
    """Return the number of steps from a release to the end of the bounces after the
    flight, at most one turn.
    """
    rate = np.cumsum(pull) * step
    landed = np.flatnonzero(np.cumsum(rate) <= 0)
    if len(landed) == 0:
        return len(pull)
    end = int(landed[0])
    bounces = 2 * restitution * abs(rate[end]) / ((1 - restitution) * abs(pull[end]))
    return min(len(pull), end + 1 + int(np.ceil(bounces / step)))


def moved(rig: Rig):
    """Yield copies of the rig, in each of which one quantity is shifted by the standard
    deviation of its tolerance.
    """
    for field in dataclasses.fields(rig):
        one = getattr(rig, field.name)
        if not isinstance(one, Quantity) or not one.tolerance:
            continue
        yield rig.replace(**{field.name: one.value + one.tolerance / np.sqrt(3)})


def _pull(rig: Rig, speed: float) -> Float[np.ndarray, " 720"]:
    """Return the acceleration away from the cam (rad/s^2) that contact suppresses."""
    system = rig.system(speed)
    times = jnp.asarray(2 * np.pi / speed / _GRID * np.arange(_GRID))
    return np.asarray(_along(system, times))


@program
def _along(system, times):
    def one(t):
        angle = system.contact_angle(system.cam_angle(t))
        guess = jnp.stack([angle, jnp.zeros_like(angle)])
        return contact_acceleration(system, t[None], guess)[0]

    return jax.vmap(one)(times)


def may_hop(rig: Rig, drive: Drive) -> Bool[np.ndarray, " k"]:
    """Return the samples of a recording at which a hidden flight is possible."""
    phases = hop_phases(rig, drive.speed)
    return phases[np.round(drive.angle / (2 * np.pi) * _GRID).astype(int) % _GRID]


def pressed(rig: Rig, drive: Drive) -> Bool[np.ndarray, " k"]:
    """Return the samples that, if they are near the surface, can be used to fit it:
    those at which no hidden flight is possible, or all samples if hidden flights are
    possible at every phase.
    """
    doubtful = may_hop(rig, drive)
    return ~doubtful | doubtful.all()


def sure_contact(
    doubtful: Bool[np.ndarray, " k"], releases: Int[np.ndarray, " releases"]
) -> Bool[np.ndarray, " k"]:
    """Return the samples at which observed contact is certain. In a stretch with
    possible hidden flights, contact is certain if the release was observed, because the
    flight was then observed, too.

    **Arguments:** the result of `may_hop`, and the samples of observed releases.
    """
    sure = ~doubtful
    for first, last in stretches(doubtful):
        if np.any((releases >= first) & (releases <= last)):
            sure[first:last] = True
    return sure


def before_release(
    angle: Float[np.ndarray, " k"], first: int, releases: Int[np.ndarray, " releases"]
) -> Bool[np.ndarray, " k"]:
    """Return the samples at which a contact that is cut off by the end of the recording
    certainly continues. They are those before the phase at which releases occur
    elsewhere in the recording, because a release just before the end would not be
    observed.

    **Arguments:** the cam angle (rad), the first sample of the contact, and the samples
    of observed releases.
    """
    if not len(releases):
        return np.ones(len(angle), dtype=bool)
    ahead = (angle[releases] - _EARLY - angle[first]) % (2 * np.pi)
    return angle < angle[first] + np.min(ahead)
