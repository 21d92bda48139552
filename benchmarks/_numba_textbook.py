"""The usual scalar loop of textbooks, compiled with numba.

It uses adaptive Dormand-Prince 5(4) steps (first same as last), Newton's method on the
step length at an impact, and the formulas of the spring and the cam as printed (thesis,
eqs. (4.9) and (4.23)), with sin, cos, asin and atan2 from the math library.
"""

import math

import numpy as np
from numba import njit

from ._workloads import (
    CAM_RADIUS,
    CENTRE,
    CHATTER,
    ECCENTRICITY,
    HALF_HEIGHT,
    INERTIA,
    release_time,
    SPRING_REACH,
    SPRING_X,
    STIFFNESS,
    Workload,
)


X0, Y0 = CENTRE
ECC, REACH = ECCENTRICITY, HALF_HEIGHT + CAM_RADIUS
STIFF = STIFFNESS / INERTIA


@njit(inline="always")
def _spring(q):
    """Angular acceleration (thesis, eq. (4.9))."""
    s, c = math.sin(q), math.cos(q)
    stretch = SPRING_X * s / c + HALF_HEIGHT / c - SPRING_REACH
    return -STIFF * stretch * (SPRING_X + HALF_HEIGHT * s) / (c * c)


@njit(inline="always")
def _spring_slope(q):
    """Derivative of the angular acceleration with respect to the angle."""
    s, c = math.sin(q), math.cos(q)
    stretch = SPRING_X * s / c + HALF_HEIGHT / c - SPRING_REACH
    first = (SPRING_X + HALF_HEIGHT * s) / (c * c)
    second = HALF_HEIGHT / c + 2 * s * first / c
    return -STIFF * (first * first + stretch * second)


@njit(inline="always")
def _contact(theta):
    """Contact angle (thesis, eq. (4.23))."""
    x, y = ECC * math.cos(theta) + X0, ECC * math.sin(theta) + Y0
    return math.asin(REACH / math.sqrt(x * x + y * y)) + math.atan2(y, x)


@njit(inline="always")
def _contact_derivatives(theta):
    """First three derivatives of the contact angle with respect to the cam angle,
    through p = x^2 + y^2.
    """
    s, c = math.sin(theta), math.cos(theta)
    p = X0 * X0 + Y0 * Y0 + ECC * ECC + 2 * ECC * (X0 * c + Y0 * s)
    p1 = 2 * ECC * (Y0 * c - X0 * s)
    p2 = -2 * ECC * (X0 * c + Y0 * s)
    m = p - REACH * REACH
    f1 = -REACH / (2 * p * math.sqrt(m))
    f2 = -f1 * (1 / p + 0.5 / m)
    f3 = f2 * f2 / f1 + f1 * (1 / (p * p) + 0.5 / (m * m))
    k = 0.5 * (ECC * ECC - X0 * X0 - Y0 * Y0) / p
    g1, g2 = -k / p, 2 * k / (p * p)
    return (
        f1 * p1 + 0.5 + k,
        f2 * p1 * p1 + f1 * p2 + g1 * p1,
        f3 * p1**3 + 3 * f2 * p1 * p2 - f1 * p1 + g2 * p1 * p1 + g1 * p2,
    )


@njit(inline="always")
def _step(q, w, k1, h):
    """One Dormand-Prince 5(4) step: state, its acceleration, two error terms."""
    v1 = w
    v2 = w + h * k1 / 5
    k2 = _spring(q + h * v1 / 5)
    v3 = w + h * (3 / 40 * k1 + 9 / 40 * k2)
    k3 = _spring(q + h * (3 / 40 * v1 + 9 / 40 * v2))
    v4 = w + h * (44 / 45 * k1 - 56 / 15 * k2 + 32 / 9 * k3)
    k4 = _spring(q + h * (44 / 45 * v1 - 56 / 15 * v2 + 32 / 9 * v3))
    a1, a2, a3, a4 = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
    v5 = w + h * (a1 * k1 + a2 * k2 + a3 * k3 + a4 * k4)
    k5 = _spring(q + h * (a1 * v1 + a2 * v2 + a3 * v3 + a4 * v4))
    a1, a2, a3, a4, a5 = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
    v6 = w + h * (a1 * k1 + a2 * k2 + a3 * k3 + a4 * k4 + a5 * k5)
    k6 = _spring(q + h * (a1 * v1 + a2 * v2 + a3 * v3 + a4 * v4 + a5 * v5))
    b1, b3, b4, b5, b6 = 35 / 384, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
    w1 = w + h * (b1 * k1 + b3 * k3 + b4 * k4 + b5 * k5 + b6 * k6)
    q1 = q + h * (b1 * v1 + b3 * v3 + b4 * v4 + b5 * v5 + b6 * v6)
    k7 = _spring(q1)
    e1, e3, e4 = 71 / 57600, -71 / 16695, 71 / 1920
    e5, e6, e7 = -17253 / 339200, 22 / 525, -1 / 40
    dq = h * (e1 * v1 + e3 * v3 + e4 * v4 + e5 * v5 + e6 * v6 + e7 * w1)
    dw = h * (e1 * k1 + e3 * k3 + e4 * k4 + e5 * k5 + e6 * k6 + e7 * k7)
    return q1, w1, k7, dq, dw


@njit(cache=True, error_model="numpy")
def _lane(speed, r, q, w, release, tolerance, samples):
    """Integrate one trajectory, fill samples (turns, 2), return numbers of impacts and
    steps.
    """
    turns = samples.shape[0]
    period = 2 * math.pi / speed
    # Longer steps jump over contacts: the cam may touch and leave within one step.
    longest = period / 40
    t, h = 0.0, longest
    k = _spring(q)
    done = impacts = steps = 0
    while done < turns:
        strobe = (done + 1) * period
        step = min(h, strobe - t)
        q1, w1, k1, dq, dw = _step(q, w, k, step)
        steps += 1
        scale_q = tolerance * (1 + max(abs(q), abs(q1)))
        scale_w = tolerance * (1 + max(abs(w), abs(w1)))
        error = max(abs(dq) / scale_q, abs(dw) / scale_w, 1e-10)
        factor = min(5.0, max(0.2, 0.9 * error**-0.2))
        if error > 1:
            h = step * factor
            continue
        gap = q1 - _contact(-speed * (t + step))
        if gap >= 0:
            sampled = step == strobe - t
            t, q, w, k = t + step, q1, w1, k1
            h = min(max(h, step * factor) if sampled else step * factor, longest)
            if sampled:
                samples[done, 0], samples[done, 1] = q, w
                done += 1
            continue
        # The gap closed within the step: Newton's method on its length.
        for _ in range(20):
            c1, _, _ = _contact_derivatives(-speed * (t + step))
            step = min(max(step - gap / (w1 + speed * c1), 0.0), 2 * step)
            q1, w1, k1, dq, dw = _step(q, w, k, step)
            steps += 1
            gap = q1 - _contact(-speed * (t + step))
            if abs(gap) < 1e-12:
                break
        impacts += 1
        t += step
        theta = -speed * t
        c1, c2, c3 = _contact_derivatives(theta)
        q = _contact(theta)
        u = -r * (w1 + speed * c1)
        w = u - speed * c1
        k = _spring(q)
        a = k - speed * speed * c2
        j = _spring_slope(q) * w + speed**3 * c3
        # Half of the predicted flight, or the step could jump over the next contact.
        h = min(h, abs(u / a))
        if a < 0 and abs(j) * u < CHATTER * (1 - r) * a * a:
            stuck = t - 2 * u / (a * (1 - r)) - 4 / 3 * j * u**2 / a**3 / (1 - r) ** 2
            let_go = release + period * math.ceil((t - release) / period)
            if stuck < let_go:
                c1, _, _ = _contact_derivatives(0.0)
                while done < turns and (done + 1) * period <= let_go:
                    samples[done, 0], samples[done, 1] = _contact(0.0), -speed * c1
                    done += 1
                t = let_go
                theta = -speed * t
                c1, _, _ = _contact_derivatives(theta)
                q, w = _contact(theta), -speed * c1
                k, h = _spring(q), 1e-2 * period
    return impacts, steps


@njit(cache=True, error_model="numpy")
def _lanes(speed, r, start, release, tolerance, samples, impacts, steps):
    for i in range(speed.size):
        q, w = start[i]
        impacts[i], steps[i] = _lane(
            speed[i], r[i], q, w, release[i], tolerance, samples[i]
        )


def simulate(workload: Workload, tolerance: float = 1e-9):
    """Run every trajectory of a workload.

    Returns samples (lanes, turns, 2) at t = period, 2 period, ..., impacts (lanes,)
    and steps (lanes,).
    """
    lanes = len(workload.speed)
    samples = np.empty((lanes, workload.turns, 2))
    impacts, steps = np.zeros(lanes, np.int64), np.zeros(lanes, np.int64)
    release = release_time(workload.speed)
    _lanes(
        workload.speed,
        workload.restitution,
        workload.start,
        release,
        tolerance,
        samples,
        impacts,
        steps,
    )
    return samples, impacts, steps
