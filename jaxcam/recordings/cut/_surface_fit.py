"""Fit the profile of a cam to the recorded impacts and contacts.

Impacts and contacts lie on the true profile. They are used to correct the nominal
profile within the tolerances of the rig.
"""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy.ndimage import uniform_filter1d

from .._drive import Drive, read_drive
from .._recording import Recording
from .._rig import Rig
from ._bend import bend_sizes, Seen, WAVES
from ._contact_stretches import stretches
from ._firm_contact import firm_contact
from ._hidden_hops import pressed
from ._impact_points import impact_points
from ._padding import padded
from ._surface import (
    linearise,
    nominal_surface,
    prior_sizes,
    Surface,
    vector_of,
    with_vector,
)


# Largest gap of a hidden flight, in units of the noise
_NEAR = 3.0
# Number of samples that are averaged, and accepted penetration of the cam in units of
# the noise: 4.5 standard errors of the mean, which noise hardly reaches
_TOGETHER, _BEHIND = 9, 1.5
# Half-widths (rad), in successive fits, of the band around the surface in which samples
# count as contact: from the accuracy of a surface fitted to impacts alone to the noise
# of the encoder
_BANDS = (2e-3, 1e-3, 5e-4)


def fit_surface(
    recordings: Sequence[Recording],
    rig: Rig,
    drives: Sequence[Drive] | None = None,
    channel: str = "follower_angle_rad",
) -> Surface:
    """Correct the nominal profile with the impacts and contacts of recordings.

    Impacts are found as velocity jumps, without the profile, and each gives one point
    of the profile, at which the motions before and after it meet. The profile through
    those points then reveals the contacts, which correct it further. The tolerances
    keep each parameter near its nominal value. The result is accurate enough to segment
    the recordings; `refine_surface` improves it to the accuracy of the data.

    The example continues the one in [`jaxcam.recordings.segment_case`][].

    Args:
        recordings: The recordings.
        rig: The rig.
        drives: Measured motion of the drive in each recording.
        channel: The channel of the follower.

    Returns:
        A [`jaxcam.recordings.cut.Surface`][].

    Examples:
        >>> from jaxcam.recordings.cut import fit_surface, nominal_surface
        >>> rig, case = read_rig(DEMO_RIG / "rig.toml"), read_case(DEMO_RIG)
        >>> fitted, turned = fit_surface(case.recordings, rig), np.linspace(1.0, 3.5, 9)
        >>> change = fitted.angle(turned) - nominal_surface(rig).angle(turned)
        >>> round(1e3 * float(np.max(np.abs(change))), 1)  # mrad
        2.3
        >>> round(1e3 * rig.sensors.follower_floor, 2)  # noise of the sensor, mrad
        0.09
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
    """Refit the profile to the impacts and contacts in `Segments`.

    A contact is used from the time at which its unobserved impacts have died out.
    Before that time, the follower bounces close to the cam and is never below it. These
    earlier samples together count as one rough point of the profile; without them,
    parts of the cam that are observed only there would be undetermined. A dent is
    included if the recordings agree on it.

    The example continues the one in [`jaxcam.recordings.cut.fit_surface`][].

    Args:
        surface: The surface to refine.
        rig: The rig.
        segments: The segments of each recording.

    Returns:
        A [`jaxcam.recordings.cut.Surface`][].

    Examples:
        >>> from jaxcam.recordings.cut import refine_surface
        >>> refined = refine_surface(fitted, rig, parts)
        >>> turned = np.linspace(0.0, 6.2, 32)  # also where the cam is rarely touched
        >>> change = refined.angle(turned) - nominal_surface(rig).angle(turned)
        >>> round(1e3 * float(np.max(np.abs(change))), 1)  # mrad
        2.3
    """
    turned, angle, error, above = [], [], [], []
    ends = []
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
        firm = firm_contact(part.recording, rig, drive.speed, part.channel, part.noise)
        turned.append(drive.angle[firm])
        angle.append(samples[firm])
        error.append(np.full(firm.sum(), part.noise))
        for contact in part.contacts:
            rows = part.resting(contact) & sure & ~firm
            turned.append(drive.angle[rows])
            angle.append(samples[rows])
            error.append(np.full(rows.sum(), part.noise))
            settled = np.searchsorted(time, contact.settled)
            bouncing = contact.first + np.flatnonzero(~firm[contact.first : settled])
            number = len(bouncing)
            turned.append(drive.angle[bouncing])
            angle.append(samples[bouncing])
            error.append(np.full(number, _NEAR * np.sqrt(number) * part.noise))
        ends.append(sum(map(len, turned)))
    count = sum(map(len, turned))
    for place, least, noise in above:
        turned.append(place)
        angle.append(least)
        error.append(np.full(len(place), noise))
    joined = [np.concatenate([*column, []]) for column in (turned, angle, error)]
    plain = _solve(_unbent(surface), rig, *joined, equal=count)
    on = [column[:count] for column in joined]
    bend = _bend(plain, rig, on[0], on[1], on[2], ends)
    if not np.any(bend):
        return plain
    return _solve(plain, rig, *joined, equal=count, bend=bend)


def _unbent(surface: Surface) -> Surface:
    return eqx.tree_at(lambda s: s.bend, surface, jnp.zeros(WAVES))


def _bend(surface: Surface, rig: Rig, turned, angle, error, ends: list[int]):
    """Return the prior standard deviations of the most likely bend, as `bend_sizes`
    does. The points of each recording end at the index in `ends`.
    """
    vector = vector_of(surface)
    misfit, rows, weight = _weighted(surface, vector, turned, angle, error)
    records = []
    for first, last in zip([0, *ends], ends):
        here = slice(first, last)
        pulled = rows[here].T * weight[here]
        records.append(Seen(pulled @ rows[here], pulled @ misfit[here]))
    sizes = prior_sizes(rig)
    off = vector_of(nominal_surface(rig))[:-WAVES] - vector[:-WAVES]
    noise = rig.sensors.follower_floor
    return bend_sizes(records, sizes**-2.0, off / sizes**2, noise)


def _impact_points(recording, drive, channel, noise, sure):
    """Return cam angle, follower angle and its error at each jump in velocity."""
    _, turned, angle, error = impact_points(recording, drive, channel, noise)
    if len(turned):
        return turned, angle, error
    # a recording without impacts is either in permanent contact, or gives no
    # information
    rows = np.flatnonzero(sure)[::8]
    return drive.angle[rows], recording[channel][rows], np.full(len(rows), 4 * noise)


def _with_contacts(surface, recording, drive, channel, band, noise, impacts, sure):
    """Return impact points and every eighth sample of stretches inside the band."""
    gap = recording[channel] - surface.angle(drive.angle)
    shortest = max(4, round(0.008 / recording.interval))
    inside = (np.abs(gap) < band) & sure
    keep = np.zeros(len(gap), dtype=bool)
    for start, stop in stretches(inside):
        if stop - start >= shortest:
            keep[start:stop:8] = True
    found = (drive.angle[keep], recording[channel][keep], np.full(keep.sum(), noise))
    return tuple(np.concatenate(pair) for pair in zip(impacts, found))


def _solve(
    surface: Surface,
    rig: Rig,
    turned,
    angle,
    error,
    *,
    equal: int | None = None,
    bend: np.ndarray | None = None,
) -> Surface:
    """Fit a surface by Gauss-Newton, with the tolerances as prior and Huber weights for
    the points.

    The first `equal` points lie on the profile, the others on or above it. Coefficients
    of a bend have the prior standard deviations `bend`.
    """
    nominal = vector_of(nominal_surface(rig))
    sizes = np.append(prior_sizes(rig), np.zeros(WAVES) if bend is None else bend)
    free = sizes > 0
    known = np.outer(sizes[free], sizes[free])
    vector = vector_of(surface)
    covariance = np.diag(sizes**2)
    for _ in range(8):
        misfit, rows, weight = _weighted(surface, vector, turned, angle, error, equal)
        pulled = rows[:, free].T * weight
        # in units of the tolerances, the matrix is well scaled
        normal = (pulled @ rows[:, free]) * known + np.eye(free.sum())
        target = pulled @ misfit + ((nominal - vector)[free] / sizes[free] ** 2)
        inverse = known * np.linalg.inv(normal)
        covariance[np.ix_(free, free)] = inverse
        step = inverse @ target
        vector[free] += step
        if np.max(np.abs(step / sizes[free])) < 1e-6:
            break
    surface = with_vector(surface, jnp.asarray(vector))
    return eqx.tree_at(lambda s: s.covariance, surface, jnp.asarray(covariance))


def _weighted(surface, vector, turned, angle, error, equal: int | None = None):
    """Return the misfits of points and their derivatives, in units of the error, and
    the weights.
    """
    fitted, jacobian = linearise(surface, vector, padded(turned))
    count = len(turned)
    misfit = (angle - np.asarray(fitted)[:count]) / error
    on = np.abs(misfit[:equal])
    scale = max(1.0, np.median(on) / 0.6745) if len(on) else 1.0
    weight = 1 / np.maximum(1.0, np.abs(misfit) / (2 * scale))
    if equal is not None:
        weight[equal:] *= misfit[equal:] < 0
    return misfit, np.asarray(jacobian)[:count] / error[:, None], weight
