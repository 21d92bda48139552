"""The fastest scalar loop found, compiled with numba.

* Steps of order 8: the tableau is `diffrax.Dopri8`'s, so that both sides of the
  comparison use one method. The free follower is q'' = f(q), so stage velocities drop
  out (squared tableau, algebraically the same step) and neighbouring stages become
  independent, which hides latency.
* Every step is aimed at the landing predicted from gap, velocity, acceleration, jerk
    and snap, and is retaken only if it ends further than `reach` from the contact. The
    remainder, and every flight shorter than `reach`, is computed from a Taylor series.
    `reach=STEPS_ONLY` leaves everything but rounding to the order-8 step.
* sin and cos are polynomials; the Fourier series of the cam is a table of short
    polynomials.
"""

import math

import numpy as np
from diffrax import Dopri8
from numba import njit

from ._workloads import (
    cam,
    CHATTER,
    HALF_HEIGHT,
    INERTIA,
    release_time,
    SPRING_REACH,
    SPRING_X,
    STIFFNESS,
    Workload,
)


STEPS_ONLY = 1e-6
TAYLOR = 3e-3
# All of fastmath but "ninf": infinity stands for "no landing ahead".
_FAST = {"nnan", "nsz", "arcp", "contract", "afn", "reassoc"}
_OPTIONS = dict(error_model="numpy", fastmath=_FAST)
_STIFF = STIFFNESS / INERTIA


def _fit(function, high, degree):
    """Power-series coefficients, lowest first, of a Chebyshev interpolant on [0,
    high].
    """
    fit = np.polynomial.Chebyshev.interpolate(function, degree, domain=[0, high])
    return tuple(fit.convert(kind=np.polynomial.Polynomial).coef.tolist())


# In z = angle^2, accurate to 3e-16 for |angle| < 1.6; the spring ends at pi / 2.
_SIN = _fit(lambda z: np.sinc(np.sqrt(z) / np.pi), 2.56, 7)
_COS = _fit(lambda z: np.cos(np.sqrt(z)), 2.56, 8)

# The contact angle is a polynomial on each of _PIECES arcs, stored as derivatives.
_PIECES, _DEGREE = 256, 6
_ARC = 2 * math.pi / _PIECES


def _cam_table() -> np.ndarray:
    nodes = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1)) / 2
    middles = _ARC * (np.arange(_PIECES) + 0.5)
    values = cam(middles[:, None] + _ARC * nodes)
    powers = np.linalg.solve(np.vander(nodes, increasing=True), values.T).T
    factorials = [math.factorial(k) for k in range(_DEGREE + 1)]
    return powers * factorials / _ARC ** np.arange(_DEGREE + 1)


_CAM = _cam_table()


def _estrin(names, z):
    """Source of a polynomial summed in pairs, for a short chain of operations."""
    power = z
    while len(names) > 1:
        even, odd = names[::2], names[1::2]
        last = even[len(odd) :]
        names = [f"({b} * {power} + {a})" for a, b in zip(even, odd, strict=False)]
        names += last
        power = f"({power} * {power})"
    return names[0]


def _compile(name, text, inline):
    """Compile generated source: numba does not unroll loops over coefficients."""
    scope = dict(globals())
    exec(text, scope)
    return njit(inline=inline, **_OPTIONS)(scope[name])


def _sincos_source():
    s = _estrin([repr(x) for x in _SIN], "z")
    c = _estrin([repr(x) for x in _COS], "z")
    return f"def _sincos(q):\n    z = q * q\n    return q * ({s}), {c}\n"


_sincos = _compile("_sincos", _sincos_source(), "always")


@njit(inline="always", **_OPTIONS)
def _spring(q, scale):
    """Angular acceleration (thesis, eq. (4.9)) times `scale`, with one division."""
    s, c = _sincos(q)
    pull = (SPRING_X * s + HALF_HEIGHT) - SPRING_REACH * c
    return pull * ((-_STIFF * scale) * (SPRING_X + HALF_HEIGHT * s)) / (c * c * c)


def _step_source():
    """Source of one step of q'' = f(q): state at the end and the two error terms."""
    tableau = Dopri8().tableau
    stages = 13
    a = np.zeros((stages, stages))
    for i, row in enumerate(tableau.a_lower[: stages - 1]):
        a[i + 1, : len(row)] = row
    b, e = np.array(tableau.b_sol)[:stages], np.array(tableau.b_error)[:stages]

    def add(start, weights):
        used = [(j, x) for j, x in enumerate(weights) if abs(x) > 1e-14]
        return " + ".join([start] + [f"{float(x)!r} * k{j}" for j, x in used])

    # Each k is h^2 f: the latest one then enters the next stage in one operation.
    lines = ["def _step(q, w, k, h):", "    hw, hh, i = h * w, h * h, 1 / h"]
    lines += ["    k0 = hh * k"]
    for i in range(1, stages):
        stage = add(f"q + {float(a[i].sum())!r} * hw", (a @ a)[i])
        lines.append(f"    k{i} = _spring({stage}, hh)")
    lines += [
        f"    q1 = {add('q + hw', b @ a)}",
        f"    w1 = w + i * ({add('0.0', b)})",
        f"    return q1, w1, {add('0.0', e @ a)}, i * ({add('0.0', e)})",
    ]
    return "\n".join(lines)


_step = _compile("_step", _step_source(), "never")


@njit(inline="always", **_OPTIONS)
def _slopes(q):
    """Angular acceleration (thesis, eq. (4.9)) and its first two derivatives with
    respect to angle.
    """
    s, c = _sincos(q)
    i = 1 / c
    ii = i * i
    lever = SPRING_X + HALF_HEIGHT * s
    s0 = (SPRING_X * s + HALF_HEIGHT) * i - SPRING_REACH
    s1 = lever * ii
    s2 = (HALF_HEIGHT + 2 * s * s1) * i
    s3 = ii * (2 * SPRING_X + 5 * HALF_HEIGHT * s + 6 * s * s * s1)
    k = -_STIFF * (s0 * s1)
    k1 = -_STIFF * (s1 * s1 + s0 * s2)
    k2 = -_STIFF * (3 * s1 * s2 + s0 * s3)
    return k, k1, k2


@njit(inline="always", **_OPTIONS)
def _surface(table, speed, t):
    """Contact angle at time t and its first four time derivatives."""
    x = (-speed / _ARC) * t
    low = math.floor(x)
    x = (x - low - 0.5) * _ARC
    p = table[int(low) & (_PIECES - 1)]
    y, z, u, v, w = x / 2, x / 3, x / 4, x / 5, x / 6
    n = -speed
    nn = n * n
    c0 = p[3] + u * (p[4] + v * (p[5] + w * p[6]))
    c0 = p[0] + x * (p[1] + y * (p[2] + z * c0))
    c1 = p[1] + x * (p[2] + y * (p[3] + z * (p[4] + u * (p[5] + v * p[6]))))
    c2 = p[2] + x * (p[3] + y * (p[4] + z * (p[5] + u * p[6])))
    c3 = p[3] + x * (p[4] + y * (p[5] + z * p[6]))
    c4 = p[4] + x * (p[5] + y * p[6])
    return c0, n * c1, nn * c2, nn * n * c3, nn * nn * c4


@njit(inline="always", **_OPTIONS)
def _landing(g, v, a, j, s):
    """First later zero of the Taylor polynomial of the gap, from a point above the
    cam.
    """
    if g == 0.0:
        d = 0.25 * a * a - (2 / 3) * j * v
        d = 2 * v / (math.sqrt(d) - 0.5 * a) if d > 0 else -1.0
    else:
        d = v * v - 2 * a * g
        d = 2 * g / (math.sqrt(d) - v) if d > 0 else -1.0
    if d > 0:
        # A second iteration costs more than the steps it saves.
        y = g + d * (v + d * (a / 2 + d * (j / 6 + d * s / 24)))
        y1 = v + d * (a + d * (j / 2 + d * s / 6))
        if y1 < 0:
            d -= y / y1
    return d if d > 0 else math.inf


@njit(inline="always", **_OPTIONS)
def _dip(x, h, g, v, a, g1, v1, a1):
    """Gap at x in [0, 1] of a step, from the quintic through both of its ends."""
    v, v1, a, a1 = h * v, h * v1, h * h * a / 2, h * h * a1 / 2
    p = g1 - g - v - a
    q = v1 - v - 2 * a
    r = a1 - a
    c3, c4, c5 = 10 * p - 4 * q + r, -15 * p + 7 * q - 2 * r, 6 * p - 3 * q + r
    return g + x * (v + x * (a + x * (c3 + x * (c4 + x * c5))))


@njit(**_OPTIONS)
def _lane(table, speed, r, q, w, release, reach, tolerance, samples):
    """Integrate one trajectory, fill samples (turns, 2), return numbers of impacts and
    steps.
    """
    turns = samples.shape[0]
    period = 2 * math.pi / speed
    limit = period / 3
    t, aim, strobe = 0.0, period / 20, period
    done = impacts = steps = 0
    rest, rest1, _, _, _ = _surface(table, speed, 0.0)
    f, f1, f2 = _slopes(q)
    c, c1, c2, c3, c4 = _surface(table, speed, t)
    g = q - c
    while True:
        # (t, q, w) is a point of a flight; f.. and c.. are evaluated there.
        k1 = f1 * w
        k2 = f2 * w * w + f1 * f
        v, a = w - c1, f - c2
        h = min(_landing(g, v, a, k1 - c3, k2 - c4), aim, limit)
        while True:
            sampled = h >= strobe - t
            if sampled:
                h = strobe - t
            if h <= reach:
                q1 = q + h * (w + h * (f / 2 + h * (k1 / 6 + h * k2 / 24)))
                w1 = w + h * (f + h * (k1 / 2 + h * k2 / 6))
            else:
                q1, w1, dq, dw = _step(q, w, f, h)
                steps += 1
                error = max(abs(dq), abs(dw) / (1 + abs(w1))) / tolerance
                if error > 1 or (h == aim and error > 1e-6):
                    aim = h * max(0.2, 0.9 / math.sqrt(math.sqrt(math.sqrt(error))))
                elif h == aim:
                    aim = 4 * h
                if not error <= 1:
                    h = aim
                    continue
            t1 = t + h
            c, c1, c2, c3, c4 = _surface(table, speed, t1)
            e, e1, e2 = _slopes(q1)
            g1, v1, a1 = q1 - c, w1 - c1, e - c2
            d = v1 * v1 - 2 * a1 * g1
            if v1 < 0 and d > 0:
                # Time to contact from the end of the step, usually short.
                d = -2 * g1 / (v1 - math.sqrt(d))
                hit = abs(d) <= reach and (sampled or t1 + d < strobe)
            else:
                d, hit = -0.5 * h, False
            if hit:
                break
            if g1 < 0:
                h = h + d if -h < d < 0 else 0.5 * h
                continue
            if v < 0 or v1 > 0:
                x = v / (v - v1) if v < 0 < v1 else 0.5
                low = min(
                    _dip(0.5 * x, h, g, v, a, g1, v1, a1),
                    _dip(x, h, g, v, a, g1, v1, a1),
                    _dip(0.5 + 0.5 * x, h, g, v, a, g1, v1, a1),
                )
                if low < 0 and h > 1e-6:
                    h *= 0.5
                    continue
            break
        if sampled and not (hit and d < 0):
            samples[done, 0], samples[done, 1] = q1, w1
            done += 1
            strobe = period * (done + 1)
            if done == turns:
                return impacts, steps
        t, q, w, f, f1, f2, g = t1, q1, w1, e, e1, e2, g1
        if not hit:
            continue
        # Move to the contact with a Taylor series; d includes jerk and snap.
        impacts += 1
        k1 = f1 * w
        k2 = f2 * w * w + f1 * f
        if abs(d) < 1e-4:
            d -= d * d * d * (k1 - c3) / (6 * v1)
            q += d * (w + d * (f / 2 + d * k1 / 6))
            w += d * (f + d * (k1 / 2 + d * k2 / 6))
            f += d * (k1 + d * k2 / 2)
            f1 += d * f2 * w
            c1 += d * (c2 + d * (c3 / 2 + d * c4 / 6))
            c2 += d * (c3 + d * c4 / 2)
            c3 += d * c4
        else:
            j1, s1 = k1 - c3, k2 - c4
            y = g1 + d * (v1 + d * (a1 / 2 + d * (j1 / 6 + d * s1 / 24)))
            d -= y / (v1 + d * (a1 + d * j1 / 2))
            q += d * (w + d * (f / 2 + d * (k1 / 6 + d * k2 / 24)))
            w += d * (f + d * (k1 / 2 + d * k2 / 6))
            c, c1, c2, c3, c4 = _surface(table, speed, t + d)
            f, f1, f2 = _slopes(q)
        t += d
        g = 0.0
        u = -r * (w - c1)
        w = c1 + u
        a, j = f - c2, f1 * w - c3
        if a < 0 and abs(j) * u < CHATTER * (1 - r) * a * a:
            x = u / (a * (1 - r))
            stuck = t - 2 * x - (4 / 3) * j * x * x / a
            let_go = release + period * math.ceil((t - release) / period)
            if stuck < let_go:
                while strobe <= let_go:
                    samples[done, 0], samples[done, 1] = rest, rest1
                    done += 1
                    strobe = period * (done + 1)
                    if done == turns:
                        return impacts, steps
                t = let_go
                q, c1, c2, c3, c4 = _surface(table, speed, t)
                w = c1
                f, f1, f2 = _slopes(q)


@njit(**_OPTIONS)
def _lanes(table, speed, r, start, release, reach, tolerance, samples, impacts, steps):
    for i in range(speed.size):
        q, w = start[i]
        impacts[i], steps[i] = _lane(
            table, speed[i], r[i], q, w, release[i], reach, tolerance, samples[i]
        )


def simulate(workload: Workload, tolerance: float = 1e-9, reach: float = TAYLOR):
    """Run every trajectory of a workload.

    Returns samples (lanes, turns, 2) at t = period, 2 period, ..., impacts (lanes,)
    and steps (lanes,).
    """
    lanes = len(workload.speed)
    samples = np.empty((lanes, workload.turns, 2))
    impacts, steps = np.zeros(lanes, np.int64), np.zeros(lanes, np.int64)
    release = release_time(workload.speed)
    _lanes(
        _CAM,
        workload.speed,
        workload.restitution,
        workload.start,
        release,
        reach,
        tolerance,
        samples,
        impacts,
        steps,
    )
    return samples, impacts, steps
