"""Locate the impact between two flights, at the time at which their gaps agree."""

import numpy as np

from ...recordings.cut import GivenImpact
from ._windows import Flights


# Number of points per sampling interval at which the gaps of two flights are compared
_FINE = 16


def meeting(
    flights: Flights,
    left: int,
    right: int,
    bounds: tuple[int, int],
    interval: float,
    reach: int,
) -> GivenImpact | None:
    """Return the impact between two windows, or `None` if no gap jumps upwards there.
    Its time is measured from the first sample.

    **Arguments:** the rows of the windows before and after the impact; `bounds`: the
    last sample before it and the first after it, which `reach` may extend.
    """
    begin = max(bounds[0] - reach, int(flights.first[right]), int(flights.first[left]))
    width = flights.gaps.shape[1]
    end = min(bounds[1] + reach, int(flights.first[left]) + width - 1)
    if end <= begin:
        return None
    found = [
        _at_gap(flights, left, right, side, (begin, end), interval)
        for side in range(flights.gaps.shape[2])
    ]
    shown = [one for one in found if one is not None]
    return min(shown, key=lambda one: abs(one.gap), default=None)


def _at_gap(flights, left, right, side, span, interval) -> GivenImpact | None:
    begin, end = span
    rows = np.arange(begin, end + 1)

    def curve(row, values, rates):
        here = rows - flights.first[row]
        return values[row, here, side], rates[row, here, side] * interval

    fine = np.linspace(begin, end, _FINE * (end - begin) + 1)
    both = [curve(row, flights.gaps, flights.rates) for row in (left, right)]
    before, after = (_hermite(fine, rows, *one) for one in both)
    apart, jump = after[0] - before[0], after[1] - before[1]
    # the gap opens faster after an impact than before it
    crossed = np.flatnonzero((apart[:-1] <= 0) & (apart[1:] > 0))
    if len(crossed):
        middle = (begin + end) / 2
        k = int(crossed[np.argmin(np.abs(fine[crossed] - middle))])
        share = -apart[k] / (apart[k + 1] - apart[k])
    else:
        k, share = int(np.argmin(np.abs(apart[:-1]))), 0.0
    if not jump[k] > 0:
        return None
    place = fine[k] + share * (fine[k + 1] - fine[k])

    def there(values):
        return float(values[k] + share * (values[k + 1] - values[k]))

    near = int(np.clip(round(place), begin, end))
    errors = [
        (
            float(flights.gaps_stderr[row, near - flights.first[row], side]),
            float(flights.rates_stderr[row, near - flights.first[row], side]),
        )
        for row in (left, right)
    ]
    speeds = there(before[1]) / interval, there(after[1]) / interval
    spread = float(np.hypot(errors[0][0], errors[1][0]))
    # where the flights meet, the distance from the surface is the mean of both with
    # these weights
    shares = np.array([speeds[1], -speeds[0]])
    total = float(np.sum(shares))
    shares = shares / total if np.all(shares > 0) else np.full(2, 0.5)
    return GivenImpact(
        float(place) * interval,
        spread / abs(speeds[1] - speeds[0]),
        side,
        float(shares[0] * there(before[0]) + shares[1] * there(after[0])),
        float(np.hypot(shares[0] * errors[0][0], shares[1] * errors[1][0])),
        speeds[0],
        errors[0][1],
        speeds[1],
        errors[1][1],
    )


def _hermite(fine, rows, values, slopes):
    """Return the values and slopes of cubics between samples."""
    k = np.clip(fine.astype(int) - rows[0], 0, len(rows) - 2)
    u = fine - rows[k]
    jump = values[k + 1] - values[k]
    second = 3 * jump - 2 * slopes[k] - slopes[k + 1]
    third = slopes[k] + slopes[k + 1] - 2 * jump
    value = values[k] + u * (slopes[k] + u * (second + u * third))
    return value, slopes[k] + u * (2 * second + 3 * u * third)
