"""Detect ripple of the drive speed in its encoder signal.

To first order, a speed `w (1 + eps cos(phi - psi))` shifts the angle by
`eps sin(phi - psi)`. A real drive also drifts slowly: variations slower than three
quarters of its rotation frequency are fitted freely (by cosines over the length of the
recording) and do not count as ripple. The leakage of the drift into the harmonic is
estimated from the spectrum at non-harmonic multiples of the rotation frequency.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from ...recordings import Recording
from ..policy import Policy


# Lower limit of a divisor that may be zero
_TINY = 1e-300


@dataclasses.dataclass(frozen=True)
class Ripple:
    """Speed ripple of the drive, once per revolution."""

    eps: float
    """Relative amplitude."""
    eps_stderr: float
    """Standard error of `eps`."""
    psi: float
    """Phase (rad)."""
    psi_stderr: float
    """Standard error of `psi`."""
    gain: float
    """Gain in twice the log-likelihood, in excess of that from leakage of the drift."""
    p_value: float
    """Probability of such a gain without ripple."""
    count: int
    """Number of samples."""
    dispersion: float
    """Scatter of the samples about the ripple, relative to the noise."""
    per_record: dict[str, tuple[float, float]]
    """Amplitude and its standard error, by recording."""
    heldout_gain: float
    """Gain in the log-likelihood of held-out recordings."""
    inclusion: float
    """Share of the bootstrap samples in which the ripple is significant."""

    def significant(self, tests: int, policy: Policy) -> bool:
        """Return whether the gain of the ripple exceeds two thresholds: that of the
        error rate, for one of `tests` tests, and that of the BIC.

        As for any named term, it must also be significant in most bootstrap samples.
        """
        chance = chi2.isf(policy.false_alarms / tests, 2)
        asked = max(2 * math.log(self.count), chance)
        return bool(self.gain > asked) and self.inclusion >= policy.confidence

    @property
    def delta_bic(self) -> float:
        """BIC with the ripple minus BIC without it."""
        return 2 * math.log(max(self.count, 2)) - self.gain


def ripple_of(
    recordings: Sequence[Recording],
    noise: float,
    channel: str = "cam_angle_rad",
    policy: Policy = Policy(),
) -> Ripple:
    """Fit one ripple to the drive signals of all recordings.

    Args:
        recordings: The recordings.
        noise: Standard deviation of the channel's noise (rad).
        channel: The channel of the drive.
        policy: The settings.

    Returns:
        A [`jaxcam.discrepancy.evidence.Ripple`][].

    Examples:
        >>> from jaxcam.discrepancy.evidence import ripple_of
        >>> from jaxcam.recordings import Recording
        >>> angle, rng = np.linspace(0.0, 60.0, 3000), np.random.default_rng(0)
        >>> wave = angle + 1e-3 * np.sin(angle - 0.5) + rng.normal(0.0, 1e-4, 3000)
        >>> channels = {"cam_angle_rad": wave}
        >>> runs = [Recording(name, angle / 15, channels) for name in "ab"]
        >>> found = ripple_of(runs, noise=1e-4)
        >>> round(found.eps, 4), round(found.psi, 1)
        (0.001, 0.5)
    """
    orders = (1.0, *policy.drive_orders)
    amplitudes, errors, samples = [], [], 0
    for recording in recordings:
        found, error = _amplitudes(recording, channel, orders, noise, policy)
        amplitudes.append(found)
        errors.append(error)
        samples += len(recording)
    wave, error = np.array(amplitudes), np.array(errors)
    beside = np.abs(wave[:, 1:] / error[:, 1:]) ** 2 / 2
    dispersion = max(1.0, float(np.mean(beside)))
    variance = error[:, 0] ** 2 * dispersion
    weight = 1 / variance
    mean = np.sum(weight * wave[:, 0]) / np.sum(weight)
    stderr = 1 / math.sqrt(np.sum(weight))
    gain = float(abs(mean) ** 2 / stderr**2)
    eps = abs(mean)
    psi = float(np.angle(mean)) % (2 * math.pi)
    return Ripple(
        eps=float(eps),
        eps_stderr=float(stderr),
        psi=psi,
        psi_stderr=float(stderr / max(eps, _TINY)),
        gain=gain,
        p_value=float(chi2.sf(gain, 2)),
        count=samples,
        dispersion=dispersion,
        per_record={
            r.name: (float(abs(w)), float(math.sqrt(v)))
            for r, w, v in zip(recordings, wave[:, 0], variance)
        },
        heldout_gain=_held_out(wave[:, 0], variance),
        inclusion=_inclusion(
            wave[:, 0], variance, 2 * math.log(max(samples, 2)), policy.bootstrap
        ),
    )


def _held_out(wave, variance) -> float:
    """Return the gain in the log-likelihood when each recording is predicted with the
    ripple fitted to all others.
    """
    total = 0.0
    for k in range(len(wave)):
        rest = np.arange(len(wave)) != k
        if not rest.any():
            return 0.0
        mean = np.average(wave[rest], weights=1 / variance[rest])
        missed = abs(wave[k]) ** 2 - abs(wave[k] - mean) ** 2
        total += float(missed / variance[k]) / 2
    return total


def _inclusion(wave, variance, asked: float, repetitions: int) -> float:
    """Return the fraction of bootstrap samples in which the ripple is significant."""
    rng = np.random.default_rng(0)
    drawn = rng.integers(0, len(wave), (repetitions, len(wave)))
    weight = 1 / variance[drawn]
    mean = np.sum(weight * wave[drawn], axis=1) / np.sum(weight, axis=1)
    return float(np.mean(np.abs(mean) ** 2 * np.sum(weight, axis=1) > asked))


def _amplitudes(
    recording: Recording, channel: str, orders, noise: float, policy: Policy
):
    """Return the complex amplitude eps e^{i psi} of each multiple of the rotation
    frequency, and its error.
    """
    angle = recording[channel]
    if np.any(np.abs(np.diff(angle)) > np.pi):
        angle = np.unwrap(angle)
    if angle[-1] < angle[0]:
        angle = -angle
    time = recording.time - recording.time[0]
    line = np.polyfit(time, angle, 1)
    turned = np.polyval(line, time)
    rate = line[0] / (2 * np.pi)
    length = time[-1] * (1 + 1 / len(time))
    slow = np.arange(1, int(2 * length * policy.drive_wander * rate) + 1)
    wander = np.cos(np.pi * np.outer(time / length, slow))
    # polynomials too, because cosines have zero slope at the ends, unlike the signal
    ends = np.polynomial.legendre.legvander(2 * time / length - 1, policy.drive_degree)
    columns = [*ends.T, *wander.T]
    found, errors = np.zeros(len(orders), dtype=complex), np.zeros(len(orders))
    fixed, _ = np.linalg.qr(np.stack(columns, axis=1))
    rest = angle - turned
    rest = rest - fixed @ (fixed.T @ rest)
    # the first harmonic is fitted together with each of the others, into which it may
    # leak
    for k, order in enumerate(orders):
        pick = (order,) if order == 1 else (order, 1.0)
        waves = [f(o * turned) for o in pick for f in (np.sin, np.cos)]
        matrix = np.stack(waves, axis=1)
        matrix = matrix - fixed @ (fixed.T @ matrix)
        inverse = np.linalg.inv(matrix.T @ matrix)
        s, c = (inverse @ (matrix.T @ rest))[:2] * order
        # s sin + c cos = eps sin(phi - psi): s = eps cos psi, c = -eps sin psi
        found[k] = s - 1j * c
        errors[k] = noise * order * math.sqrt((inverse[0, 0] + inverse[1, 1]) / 2)
    return found, errors
