"""Flights of the impact oscillator with its wall at zero, with many digits."""

import mpmath
import numpy as np

from variational import scaling_law


def oscillator_hop(w, t, u):
    """Next impact of x'' + x = cos wt, x <= 0, after one at t with rebound speed u."""
    g = 1 / (1 - w * w)
    a, b = -g * mpmath.cos(w * t), -u + g * w * mpmath.sin(w * t)

    def position(s):
        return g * mpmath.cos(w * s) + a * mpmath.cos(s - t) + b * mpmath.sin(s - t)

    def velocity(s):
        free = -a * mpmath.sin(s - t) + b * mpmath.cos(s - t)
        return -g * w * mpmath.sin(w * s) + free

    # the wall pulls with cos wt, which falls at the rate w sin wt
    pull, fall = mpmath.cos(w * t), w * mpmath.sin(w * t)
    inside = pull * pull / 4 - 2 * u * fall / 3
    if u == 0:
        grid = np.linspace(0.05, 12.0, 4000)
        values = np.array([float(position(t + s)) for s in grid])
        first = int(np.argmax(values > 0))
        s = mpmath.findroot(position, t + (grid[first - 1] + grid[first]) / 2)
    elif inside < 0:
        return None
    else:
        first = 3 * (pull / 2 - mpmath.sqrt(inside)) / fall
        s = t + first
        for _ in range(50):
            step = position(s) / velocity(s)
            s -= step
            if abs(step) < mpmath.mpf(10) ** -38:
                break
    return s, velocity(s)


def completes(w, r):
    """Whether the orbit from release chatters to rest before the next release."""
    with mpmath.workdps(40):
        w, r = mpmath.mpf(w), mpmath.mpf(r)
        t, u = mpmath.pi / 2 / w, mpmath.mpf(0)
        end = t + 2 * mpmath.pi / w
        bar = float(scaling_law(float(r)).lambda_bar)
        for _ in range(400):
            hop = oscillator_hop(w, t, u)
            if hop is None or hop[0] >= end:
                return False
            t, u = hop[0], r * hop[1]
            # close to release the coordinate tells: it leaves lambda_bar either way
            lam = float(u / (w * (t - end) ** 2))
            if (end - t) * w < 1e-2 and lam < bar / 2:
                return True
            if (end - t) * w < 1e-2 and lam > 3 / 8:
                return False
        raise AssertionError("neither in 400 impacts")
