"""The cam as the recordings show it: the nominal profile, corrected.

A real cam differs from the nominal one by millimetres, which is tens of times the
noise of an encoder: with the nominal contact angle no contact could be told from a
low flight. The impacts and contacts of the recordings themselves lie on the true
profile, and correct it within the tolerances of the rig.
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.ndimage import uniform_filter1d

from ..models import EccentricCircle
from ._drive import Drive, read_drive
from ._hidden_hops import pressed
from ._kinks import find_kinks
from ._padding import padded
from ._polynomial import crossing, fit_local
from ._recording import Recording
from ._rig import Rig


# What remains of a cam besides its geometry: run-out, bearings, a bent shaft (rad)
_HARMONICS = (2, 3)
_HARMONIC_SIZE = 2e-4
# What the zero of the cam's angle may be off, and what a sensor that lags by half a
# millisecond makes of it (rad)
_PHASE_SIZE = 1e-2
# How far from the cam a follower may be where its bounces are too low to be seen, in
# units of the noise
_NEAR = 3.0
# Samples whose mean is looked at, and how far behind the cam it may seem to be
_TOGETHER, _BEHIND = 9, 1.5
# Least tolerance given to a length (m): a rig file may state none.
_LEAST_TOLERANCE = 2e-4
# Half-widths (rad) of the band around the surface in which samples count as contact,
# from the accuracy of the impacts alone to the noise of the encoder.
_BANDS = (2e-3, 1e-3, 5e-4)


class Surface(eqx.Module):
    """Contact angle (rad) as a function of the cam's angle: geometry and harmonics.

    - `profile`: the eccentric circle that fits best.
    - `phase`: how far ahead of its measured angle the cam seems to be (rad).
    - `cosines`, `sines`: amplitudes of harmonics 2 and 3 on top of it (rad).
    - `covariance`: of radius, eccentricity, centre, phase and amplitudes together.
    - `sense`: -1 for a clockwise cam; the angle given is counted as it turns.
    """

    profile: EccentricCircle
    phase: Float[Array, ""]
    cosines: Float[Array, " harmonics"]
    sines: Float[Array, " harmonics"]
    covariance: Float[Array, " p p"]
    sense: float = eqx.field(static=True)

    def __call__(self, turned: Float[Array, "*k"]) -> Float[Array, "*k"]:
        order = jnp.asarray(_HARMONICS, dtype=float)
        angle = self.sense * (jnp.asarray(turned) + self.phase)
        phases = jnp.multiply.outer(angle, order)
        extra = jnp.cos(phases) @ self.cosines + jnp.sin(phases) @ self.sines
        return self.profile(angle) + extra

    def angle(self, turned) -> Float[np.ndarray, " k"]:
        """The contact angle as a numpy array, shape `(k,)`."""
        turned = np.asarray(turned)
        return np.asarray(_evaluate(self, padded(turned))[0])[: len(turned)]

    def slope(self, turned) -> Float[np.ndarray, " k"]:
        """Its derivative to the angle that the cam has turned."""
        turned = np.asarray(turned)
        return np.asarray(_evaluate(self, padded(turned))[1])[: len(turned)]

    def slope_stderr(self, turned) -> Float[np.ndarray, " k"]:
        """Standard error of `slope`, large where no impact or contact was seen."""
        turned = np.asarray(turned)
        rows = np.asarray(_slope_jacobian(self, _vector(self), padded(turned)))
        rows = rows[: len(turned)]
        return np.sqrt(np.einsum("...i,ij,...j", rows, self.covariance, rows))


def nominal_surface(rig: Rig) -> Surface:
    """The profile as the rig file states it."""
    zero = jnp.zeros(len(_HARMONICS))
    sense = -1.0 if rig.cam_rotation == "clockwise" else 1.0
    covariance = jnp.diag(jnp.asarray(_prior_sizes(rig)) ** 2)
    return Surface(rig.profile(), jnp.zeros(()), zero, zero, covariance, sense)


def fit_surface(
    recordings: Sequence[Recording],
    rig: Rig,
    drives: Sequence[Drive] | None = None,
    channel: str = "follower_angle_rad",
) -> Surface:
    """Correct the nominal profile with the impacts and contacts of some recordings.

    Impacts are found as jumps in velocity, without the profile, and each gives one
    point of it: where the motion before meets the motion after. The profile through
    those points then shows the contacts, which correct it further. Each parameter
    stays near its nominal value by its tolerance. What results is good enough to cut
    the recordings; `refine_surface` makes it as good as they allow.
    """
    drives = drives or [read_drive(recording) for recording in recordings]
    noise = rig.sensors.follower_floor
    sure = [pressed(rig, drive) for drive in drives]
    points = [
        _impact_points(recording, drive, channel, noise, rows)
        for recording, drive, rows in zip(recordings, drives, sure)
    ]
    surface = _solve(
        nominal_surface(rig), rig, *(np.concatenate(p) for p in zip(*points))
    )
    for band in _BANDS:
        both = [
            _with_contacts(surface, recording, drive, channel, band, noise, *found)
            for recording, drive, *found in zip(recordings, drives, points, sure)
        ]
        surface = _solve(surface, rig, *(np.concatenate(p) for p in zip(*both)))
    return surface


def refine_surface(surface: Surface, rig: Rig, segments: Sequence) -> Surface:
    """Fit the profile again, to what `Segments` found to be impacts and contacts.

    Contacts count from where the bounces that cannot be seen have died out: before,
    the follower is above the cam on average. It is near it, though, which counts for
    one rough point, and it is never behind: where a cam is seen there alone, it would
    else be anywhere.
    """
    turned, angle, error, above = [], [], [], []
    for part in segments:
        time, drive = part.recording.time, part.drive
        samples = part.recording[part.channel]
        seen = slice(None, None, _TOGETHER)
        mean = uniform_filter1d(samples, _TOGETHER)[seen]
        above.append((drive.angle[seen], mean + _BEHIND * part.noise, part.noise))
        impacts, sure = part.impacts, pressed(rig, drive)
        sharp = impacts.time_stderr < 2 * part.recording.interval
        turned.append(np.interp(impacts.time[sharp], time, drive.angle))
        angle.append(impacts.angle[sharp])
        error.append(impacts.angle_stderr[sharp])
        for contact in part.contacts:
            rows = part.resting(contact) & sure
            turned.append(drive.angle[rows])
            angle.append(samples[rows])
            error.append(np.full(rows.sum(), part.noise))
            bouncing = slice(contact.first, np.searchsorted(time, contact.settled))
            number = len(time[bouncing])
            turned.append(drive.angle[bouncing])
            angle.append(samples[bouncing])
            error.append(np.full(number, _NEAR * np.sqrt(number) * part.noise))
    count = sum(map(len, turned))
    for place, least, noise in above:
        turned.append(place)
        angle.append(least)
        error.append(np.full(len(place), noise))
    joined = (np.concatenate([*column, []]) for column in (turned, angle, error))
    return _solve(surface, rig, *joined, equal=count)


def _impact_points(recording, drive, channel, noise, sure):
    """Cam angle, follower angle and its error at each jump in velocity."""
    time, samples = recording.time, recording[channel]
    interval = recording.interval
    kinks = find_kinks(samples, interval, noise)
    turned, angle, error = [], [], []
    reach = max(6, round(0.01 / interval))
    for kink in kinks:
        # the sample next to the impact may be on either side of it
        left = slice(max(0, kink - 1 - reach), kink - 1)
        right = slice(kink + 1, kink + 1 + reach)
        origin = float(time[kink] - interval / 2)
        before = fit_local(time[left], samples[left], noise, origin)
        after = fit_local(time[right], samples[right], noise, origin)
        moment, _ = crossing(before, after, origin, 3 * interval)
        if abs(moment - origin) >= 3 * interval:
            continue
        turned.append(np.interp(moment, time, drive.angle))
        angle.append(0.5 * (before.value(moment) + after.value(moment)))
        error.append(before.value_stderr(moment) + after.value_stderr(moment))
    if len(kinks) == 0:
        # no impact in the whole record: either all contact, or nothing to learn
        rows = np.flatnonzero(sure)[::8]
        return drive.angle[rows], samples[rows], np.full(len(rows), 4 * noise)
    return np.array(turned), np.array(angle), np.array(error)


def _with_contacts(surface, recording, drive, channel, band, noise, impacts, sure):
    """Impact points and every eighth sample of stretches inside the band."""
    gap = recording[channel] - surface.angle(drive.angle)
    shortest = max(4, round(0.008 / recording.interval))
    inside = (np.abs(gap) < band) & sure
    keep = np.zeros(len(gap), dtype=bool)
    for start, stop in stretches(inside):
        if stop - start >= shortest:
            keep[start:stop:8] = True
    found = (drive.angle[keep], recording[channel][keep], np.full(keep.sum(), noise))
    return tuple(np.concatenate(pair) for pair in zip(impacts, found))


def stretches(mask: np.ndarray) -> list[tuple[int, int]]:
    """Start and end (one past the last) of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2])]


def _solve(
    surface: Surface, rig: Rig, turned, angle, error, *, equal: int | None = None
) -> Surface:
    """Gauss-Newton with the tolerances as prior and Huber weights on the points.

    The first `equal` points lie on the profile, the others on it or above.
    """
    nominal = _vector(nominal_surface(rig))
    sizes = _prior_sizes(rig)
    count = len(turned)
    places = padded(turned)
    vector = _vector(surface)
    covariance = np.diag(sizes**2)
    for _ in range(8):
        fitted, jacobian = _linearise(surface, vector, places)
        misfit = (angle - np.asarray(fitted)[:count]) / error
        on = np.abs(misfit[:equal])
        scale = max(1.0, np.median(on) / 0.6745) if len(on) else 1.0
        weight = 1 / np.maximum(1.0, np.abs(misfit) / (2 * scale))
        if equal is not None:
            weight[equal:] *= misfit[equal:] < 0
        rows = np.asarray(jacobian)[:count] / error[:, None]
        normal = rows.T @ (weight[:, None] * rows) + np.diag(sizes**-2.0)
        target = rows.T @ (weight * misfit) + (nominal - vector) / sizes**2
        # in units of the tolerances the matrix is well scaled
        covariance = np.outer(sizes, sizes) * np.linalg.inv(
            normal * np.outer(sizes, sizes)
        )
        step = covariance @ target
        vector = vector + step
        if np.max(np.abs(step / sizes)) < 1e-6:
            break
    surface = _with_vector(surface, jnp.asarray(vector))
    return eqx.tree_at(lambda s: s.covariance, surface, jnp.asarray(covariance))


def _prior_sizes(rig: Rig) -> np.ndarray:
    geometry = [
        np.hypot(rig.cam_radius.tolerance, rig.follower_half_height.tolerance),
        rig.cam_eccentricity.tolerance,
        rig.cam_center_x.tolerance,
        rig.cam_center_y.tolerance,
    ]
    harmonics = np.full(2 * len(_HARMONICS), _HARMONIC_SIZE)
    geometry = np.maximum(geometry, _LEAST_TOLERANCE)
    return np.concatenate([geometry, [_PHASE_SIZE], harmonics])


def _vector(surface: Surface) -> np.ndarray:
    p = surface.profile
    geometry = [p.radius + p.half_height, p.eccentricity, p.center_x, p.center_y]
    parts = [np.array([*geometry, surface.phase]), surface.cosines, surface.sines]
    return np.concatenate(parts)


def _with_vector(surface: Surface, vector) -> Surface:
    # only the sum of radius and half height is seen; the radius takes it
    radius = vector[0] - surface.profile.half_height
    cosines, sines = jnp.split(vector[5:], 2)
    return eqx.tree_at(
        lambda s: (
            s.profile.radius,
            s.profile.eccentricity,
            s.profile.center_x,
            s.profile.center_y,
            s.phase,
            s.cosines,
            s.sines,
        ),
        surface,
        (radius, vector[1], vector[2], vector[3], vector[4], cosines, sines),
    )


@eqx.filter_jit
def _linearise(surface, vector, turned):
    def contact_angle(vector):
        return _with_vector(surface, vector)(turned)

    return contact_angle(vector), jax.jacfwd(contact_angle)(vector)


@eqx.filter_jit
def _evaluate(surface, turned):
    turned = jnp.asarray(turned)
    return jax.jvp(surface, (turned,), (jnp.ones_like(turned),))


@eqx.filter_jit
def _slope_jacobian(surface, vector, turned):
    turned = jnp.asarray(turned)

    def slope(vector):
        profile = _with_vector(surface, vector)
        return jax.jvp(profile, (turned,), (jnp.ones_like(turned),))[1]

    return jax.jacfwd(slope)(vector)
