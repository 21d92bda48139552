"""Time of a fit, beside scipy's least squares around solve_ivp with differences.

Both start at the nominal rig. The project fits ten parameters and all of the motion.
The rival gets the easier part: four parameters of free flight and the state at the
beginning of every flight, no impacts and no contacts; and all that helps it: a sparse
pattern, so that all states together cost two columns of differences, scales, and the
tolerances as a prior.

    python benchmarks/fitting.py --runs 6
"""

import argparse
import math
import resource
import time

import numpy as np
import scipy.optimize
import scipy.sparse
from coverage import at_level, random_rig, recording
from scipy.integrate import solve_ivp

from jaxcam import fitting
from jaxcam.data import DEMO_RIG
from jaxcam.data.make_demo import simulate_rig
from jaxcam.recordings import read_rig, segment_case


def make_runs(number: int, seed: int = 4):
    rng = np.random.default_rng(seed)
    nominal = at_level(read_rig(DEMO_RIG / "rig.toml"), 1.0)
    real = random_rig(nominal, rng)
    speeds = np.linspace(135.0, 170.0, number)
    return nominal, [
        recording(
            simulate_rig(real, rpm * math.pi / 30, 4.0, settle=6.0),
            nominal.sensors,
            f"run{k}",
            rng,
        )
        for k, rpm in enumerate(speeds, start=1)
    ]


def rival(nominal, segments, limit: int):
    """Seconds, evaluations of all flights, and the cost it ended at."""
    sigma = nominal.sensors.follower_floor
    flights = []
    for part in segments:
        time_, samples = part.recording.time, part.recording["follower_angle_rad"]
        for flight in part.flights:
            rows = np.arange(flight.first + 2, flight.last - 2)
            if len(rows) >= 16:
                flights.append((time_[rows], samples[rows]))
    start = np.array(
        [
            nominal.spring_stiffness.value,
            nominal.spring_hook_x.value,
            nominal.spring_elongation.value,
            nominal.follower_half_height.value,
        ]
    )
    size = np.array(
        [
            nominal.spring_stiffness.tolerance,
            nominal.spring_hook_x.tolerance,
            nominal.spring_elongation.tolerance,
            nominal.follower_half_height.tolerance,
        ]
    )
    states = []
    for t, y in flights:
        early = slice(0, min(len(t), 30))
        c = np.polyfit(t[early] - t[0], y[early], 2)
        states += [c[2], c[1]]
    x0 = np.concatenate([np.zeros(4), states])
    count = 0

    def residual(x):
        nonlocal count
        count += 1
        k, hook, long, half = start + size * x[:4]
        rate = k / nominal.inertia.value

        def field(t, s):
            sine, secant = math.sin(s[0]), 1 / math.cos(s[0])
            stretch = (hook * sine + half) * secant - long
            return [s[1], -rate * stretch * (hook + half * sine) * secant**2]

        found = [math.sqrt(3.0) * x[:4]]
        for n, (t, y) in enumerate(flights):
            solved = solve_ivp(
                field,
                (t[0], t[-1]),
                x[4 + 2 * n : 6 + 2 * n],
                t_eval=t,
                rtol=1e-8,
                atol=1e-10,
            )
            found.append((y - solved.y[0]) / sigma)
        return np.concatenate(found)

    rows = [4, *(len(t) for t, _ in flights)]
    pattern = scipy.sparse.lil_matrix((sum(rows), len(x0)), dtype=int)
    pattern[:, :4] = 1
    begin = 4
    for n, length in enumerate(rows[1:]):
        pattern[begin : begin + length, 4 + 2 * n : 6 + 2 * n] = 1
        begin += length
    begun = time.process_time()
    found = scipy.optimize.least_squares(
        residual, x0, jac_sparsity=pattern, x_scale="jac", max_nfev=limit
    )
    return time.process_time() - begun, count, 2 * found.cost, found.nfev


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=6)
    parser.add_argument("--evaluations", type=int, default=8, help="of the rival")
    options = parser.parse_args()
    nominal, runs = make_runs(options.runs)
    segments = segment_case(runs, nominal)
    model = fitting.cam_follower_model(nominal)
    parameters = fitting.cam_follower_parameters(nominal)
    sensor = "follower_angle_rad"
    # a tenth parameter: the encoder of the follower may be late
    parameters.append(
        fitting.Parameter("lag", lambda m: m.sensors[sensor].lag, tolerance=1e-4)
    )
    for run in ("first (compiling)", "warm"):
        clock, begun = time.time(), time.process_time()
        problem = fitting.Problem.build(model, segments, parameters)
        found = fitting.fit(problem)
        print(
            f"{run}: {problem.samples} samples, {len(found.estimates)} parameters, "
            f"{found.iterations} iterations: {time.time() - clock:.2f} s "
            f"({time.process_time() - begun:.2f} s of CPU); {found.message}",
            flush=True,
        )
    clock, begun = time.time(), time.process_time()
    again = fitting.fit(problem, start=found)
    print(
        f"again from its optimum: {time.time() - clock:.2f} s "
        f"({time.process_time() - begun:.2f} s of CPU), {again.iterations} iterations"
    )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024**2
    print(f"peak memory {peak:.2f} GB", flush=True)
    seconds, count, cost, steps = rival(nominal, segments, options.evaluations)
    print(
        f"scipy, four parameters of the flights alone: {seconds:.1f} s of CPU for "
        f"{steps} steps ({count} evaluations), cost {cost:.0f}"
    )


if __name__ == "__main__":
    main()
