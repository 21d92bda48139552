"""The baseline for the fit: scipy's least squares around `solve_ivp`, with impacts.

It is written in the usual way: a record is cut into windows of about a turn, each with
its own initial state in the middle of a long flight; flights are `solve_ivp` with a
terminal event, restarted at impacts; chatter ends in sustained contact, and contact
ends at release. Parameters and initial states are estimated together with finite
differences. The baseline has several advantages: a sparsity pattern, so that all
initial states cost two columns of differences; difference steps well above the
integration error; the drive angle as measured by its encoder; and the tolerances as a
prior. It does not require a window to begin where the previous one ends.
"""

import dataclasses
import math
import time

import numpy as np
import scipy.optimize
import scipy.sparse
from scipy.integrate import solve_ivp


NAMES = (
    "stiffness",
    "spring_hook_x",
    "spring_elongation",
    "spring_half_height",
    "cam_radius",
    "cam_eccentricity",
    "cam_center_x",
    "cam_center_y",
    "restitution",
    "lag",
)
_TOLERANCE = 1e-8
# Flights shorter than this (s), and all that follow, count as contact
_REST = 1e-6


@dataclasses.dataclass(frozen=True)
class Window:
    """About a turn of a record: samples, and the cam angle as `a + b t`."""

    time: np.ndarray
    samples: np.ndarray
    phase: float
    speed: float
    start: tuple[float, float]


def windows(part) -> list[Window]:
    """Windows from the middle of the longest flight of a turn to that of the next
    turn.
    """
    clock, samples = part.recording.time, part.recording["follower_angle_rad"]
    angle = part.drive.angle
    turn = np.floor((angle - angle[0]) / (2 * np.pi))
    begins = []
    for number in range(int(turn[-1]) + 1):
        inside = [f for f in part.flights if turn[f.first] == number]
        if inside:
            longest = max(inside, key=lambda f: f.last - f.first)
            if longest.last - longest.first >= 24:
                begins.append((longest.first + longest.last) // 2)
    found = []
    for first, last in zip(begins, begins[1:]):
        rows = np.arange(first, last)
        speed, phase = np.polyfit(clock[rows], angle[rows], 1)
        near = np.arange(first - 10, first + 11)
        c = np.polyfit(clock[near] - clock[first], samples[near], 2)
        found.append(
            Window(clock[rows], samples[rows], phase, speed, (float(c[2]), float(c[1])))
        )
    return found


def predict(window: Window, state, values, rate: float, half: float) -> np.ndarray:
    """The encoder samples of a window; `rate` is K/J, `half` the half height of the
    profile.
    """
    _, hook, long, spring_half, radius, eccentric, cx, cy, r, lag = values
    height = radius + half
    speed = window.speed

    def acceleration(x):
        sine, secant = math.sin(x), 1 / math.cos(x)
        stretch = (hook * sine + spring_half) * secant - long
        return -rate * stretch * (hook + spring_half * sine) * secant**2

    def surface(t):
        turned = window.phase + speed * t
        x, y = eccentric * math.cos(turned) + cx, -eccentric * math.sin(turned) + cy
        dx, dy = -eccentric * math.sin(turned), -eccentric * math.cos(turned)
        q = x * x + y * y
        side = math.sqrt(q - height * height)
        angle = math.atan2(height, side) + math.atan2(y, x)
        slope = -height * (x * dx + y * dy) / (q * side) + (x * dy - y * dx) / q
        return angle, speed * slope

    def pull(t, x):
        """Acceleration of the follower towards the cam (rad/s^2)."""
        h = 1e-5
        bend = (surface(t + h)[1] - surface(t - h)[1]) / (2 * h)
        return bend - acceleration(x)

    def field(_, s):
        return s[1], acceleration(s[0])

    def gap(t, s):
        return s[0] - surface(t)[0]

    gap.terminal, gap.direction = True, -1

    times, out = window.time, np.empty_like(window.samples)
    done, t, s, longest = 0, times[0], np.array(state, dtype=float), None
    end = times[-1]
    while done < len(times):
        flight = solve_ivp(
            field,
            (t, end),
            s,
            events=gap,
            t_eval=times[done:],
            rtol=_TOLERANCE,
            atol=_TOLERANCE,
            max_step=math.pi / (20 * speed),
            first_step=None if longest is None or t == end else min(longest, end - t),
        )
        passed = len(flight.t)
        if passed:
            rows = np.reshape(flight.y, (2, passed))
            out[done : done + passed] = rows[0] - lag * rows[1]
        done += passed
        if flight.status != 1:
            break
        t, (x, before) = flight.t_events[0][0], flight.y_events[0][0]
        contact = surface(t)[1]
        after = contact + r * (contact - before)
        force = pull(t, x)
        s = np.array([x, after])
        longest = 2 * (after - contact) / force if force > 0 else 1e-3
        if longest > _REST * (1 - r):
            longest /= 2
            continue
        # contact until the cam falls away faster than the follower
        step, later = 1e-3, t
        while later < end and pull(later + step, surface(later + step)[0]) > 0:
            later += step
        if later < end:
            later = scipy.optimize.brentq(
                lambda u: pull(u, surface(u)[0]), later, later + step, xtol=1e-10
            )
        while done < len(times) and times[done] <= later:
            angle, rate_of = surface(times[done])
            out[done] = angle - lag * rate_of
            done += 1
        if done == len(times):
            break
        t, s, longest = later, np.array(surface(later)), 1e-5
    out[done:] = out[done - 1] if done else state[0]
    return out


@dataclasses.dataclass(frozen=True)
class Rival:
    """Result of scipy's fit: CPU time in total and per iteration (a step and its
    differences).
    """

    seconds: float
    iterations: int
    evaluations: int
    simulated: float
    cost: float
    samples: int
    values: dict[str, float]
    converged: bool

    @property
    def per_iteration(self) -> float:
        return self.seconds / max(1, self.iterations)


def fit_with_scipy(nominal, found: list[Window], parameters, limit: int) -> Rival:
    """Fit some windows in at most `limit` steps."""
    sigma = nominal.sensors.follower_floor
    inertia, half = nominal.inertia.value, nominal.follower_half_height.value
    tolerance = np.array([p.tolerance for p in parameters])
    middle = np.array(
        [
            nominal.spring_stiffness.value,
            nominal.spring_hook_x.value,
            nominal.spring_elongation.value,
            half,
            nominal.cam_radius.value,
            nominal.cam_eccentricity.value,
            nominal.cam_center_x.value,
            nominal.cam_center_y.value,
            nominal.restitution.value,
            0.0,
        ]
    )
    count = 0

    def residual(x):
        nonlocal count
        count += 1
        # one is nominal, so that all steps are the same fraction of their tolerances
        values = middle + tolerance * (x[:10] - 1)
        rows = [math.sqrt(3.0) * (x[:10] - 1)]
        for k, window in enumerate(found):
            state = x[10 + 2 * k : 12 + 2 * k]
            seen = predict(window, state, values, values[0] / inertia, half)
            rows.append((window.samples - seen) / sigma)
        return np.concatenate(rows)

    x0 = np.concatenate([np.ones(10), *(np.array(w.start) for w in found)])
    lengths = [10, *(len(w.time) for w in found)]
    pattern = scipy.sparse.lil_matrix((sum(lengths), len(x0)), dtype=int)
    pattern[:, :10] = 1
    begin = 10
    for k, length in enumerate(lengths[1:]):
        pattern[begin : begin + length, 10 + 2 * k : 12 + 2 * k] = 1
        begin += length
    begun = time.process_time()
    solved = scipy.optimize.least_squares(
        residual,
        x0,
        jac_sparsity=pattern,
        x_scale="jac",
        diff_step=1e-5,
        ftol=1e-6,
        max_nfev=limit,
    )
    seconds = time.process_time() - begun
    return Rival(
        seconds,
        solved.njev,
        count,
        sum(float(w.time[-1] - w.time[0]) for w in found),
        2 * solved.cost,
        sum(lengths[1:]),
        dict(zip(NAMES, middle + tolerance * (solved.x[:10] - 1))),
        solved.status > 0,
    )
