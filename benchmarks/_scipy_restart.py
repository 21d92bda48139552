"""The textbook method in Python: `solve_ivp` with a terminal event, restarted at
impacts.

It also serves as the accuracy reference, with `method="DOP853"` and a tolerance of
1e-12. Flight, impact, chatter, sticking and release follow the same rules as the other
sides of the comparison.
"""

import numpy as np
from scipy.integrate import solve_ivp

from ._workloads import cam, CHATTER, contact_angle, release_time, spring, Workload


def _lane(speed, r, start, turns, release, method, tolerance):
    period = 2 * np.pi / speed
    strobes = period * np.arange(1, turns + 1)
    samples = np.empty((turns, 2))
    impacts = steps = 0

    def field(t, state):
        return state[1], spring(state[0])

    def gap(t, state):
        return state[0] - contact_angle(-speed * t)

    gap.terminal, gap.direction = True, -1

    def on_cam(t):
        theta = -speed * t
        return contact_angle(theta), -speed * cam(theta, 1)

    t, state, first, done = 0.0, np.array(start), None, 0
    while done < turns:
        flight = solve_ivp(
            field,
            (t, strobes[-1]),
            state,
            method=method,
            events=gap,
            t_eval=strobes[done:],
            rtol=tolerance,
            atol=tolerance,
            max_step=period / 40,
            first_step=None if first is None else min(first, strobes[-1] - t),
        )
        steps += flight.nfev // (6 if method == "RK45" else 12)
        passed = len(flight.t)
        samples[done : done + passed] = np.reshape(flight.y, (2, passed)).T
        done += passed
        if flight.status != 1:
            break
        t, (angle, before) = flight.t_events[0][0], flight.y_events[0][0]
        impacts += 1
        theta = -speed * t
        contact = -speed * cam(theta, 1)
        after = contact - r * (before - contact)
        u = after - contact
        a = spring(angle) - speed**2 * cam(theta, 2)
        slope = (spring(angle + 1e-5) - spring(angle - 1e-5)) / 2e-5
        j = slope * after + speed**3 * cam(theta, 3)
        state = np.array([contact_angle(theta), after])
        # Half of the predicted flight; otherwise the event at the start would hide the
        # next.
        first = abs(u / a)
        if a < 0 and abs(j) * u < CHATTER * (1 - r) * a * a:
            stuck = t - 2 * u / (a * (1 - r)) - 4 / 3 * j * u**2 / a**3 / (1 - r) ** 2
            let_go = release + period * np.ceil((t - release) / period)
            if stuck < let_go:
                while done < turns and strobes[done] <= let_go:
                    samples[done] = on_cam(strobes[done])
                    done += 1
                t, state, first = let_go, np.array(on_cam(let_go)), 1e-3 * period
    return samples, impacts, steps


def simulate(workload: Workload, lanes=None, method="RK45", tolerance=1e-9):
    """Run the given trajectories (all by default).

    Returns samples (lanes, turns, 2) at t = period, 2 period, ..., impacts (lanes,)
    and steps (lanes,).
    """
    lanes = range(len(workload.speed)) if lanes is None else lanes
    results = [
        _lane(
            workload.speed[k],
            workload.restitution[k],
            workload.start[k],
            workload.turns,
            release_time(workload.speed[k])[0],
            method,
            tolerance,
        )
        for k in lanes
    ]
    samples, impacts, steps = zip(*results, strict=True)
    return np.array(samples), np.array(impacts), np.array(steps)
