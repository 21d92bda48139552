"""Measure the time of a fit, and compare it with scipy's least squares around
solve_ivp.

Both start at the nominal rig and fit the same ten parameters to the same records, with
impacts, chatter and sustained contact (`_scipy_fit.py`). The scipy baseline is run on a
few turns until it ends; its time for all records is the time per iteration, scaled to
the total duration of the motion, times the number of iterations.

    python benchmarks/fitting.py --runs 6 --turns 3
"""

import argparse
import math
import resource
import time

import numpy as np
from _scipy_fit import fit_with_scipy, windows
from coverage import at_level, random_rig, recording

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


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=6)
    parser.add_argument(
        "--turns", type=int, default=3, help="turns of each run fitted by scipy"
    )
    parser.add_argument(
        "--rival-runs", type=int, default=2, help="runs fitted by scipy"
    )
    parser.add_argument(
        "--steps", type=int, default=30, help="maximum number of scipy steps"
    )
    options = parser.parse_args()
    nominal, runs = make_runs(options.runs)
    segments = segment_case(runs, nominal)
    model = fitting.cam_follower_model(nominal)
    parameters = fitting.cam_follower_parameters(nominal)
    sensor = "follower_angle_rad"
    # a tenth parameter: the delay of the follower encoder
    parameters.append(
        fitting.Parameter("lag", lambda m: m.sensors[sensor].lag, tolerance=1e-4)
    )
    warm = math.nan
    for run in ("first (compiling)", "warm"):
        clock, begun = time.time(), time.process_time()
        problem = fitting.Problem.build(model, segments, parameters)
        found = fitting.fit(problem)
        warm = time.process_time() - begun
        print(
            f"{run}: {problem.samples} samples, {len(found.estimates)} parameters, "
            f"{found.iterations} iterations: {time.time() - clock:.2f} s "
            f"({warm:.2f} s of CPU); {found.message}",
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
    # spread over the speeds, since chatter is expensive for an event-driven baseline
    chosen = np.linspace(0, options.runs - 1, options.rival_runs).astype(int)
    cut = [windows(part) for part in segments]
    whole = sum(float(w.time[-1] - w.time[0]) for turns in cut for w in turns)
    small = [w for k in chosen for w in cut[k][: options.turns]]
    other = fit_with_scipy(nominal, small, parameters, options.steps)
    ended = "ended" if other.converged else "had not ended"
    print(
        f"scipy on {len(small)} turns ({other.simulated:.2f} s of motion, "
        f"{other.samples} samples): {other.seconds:.1f} s of CPU, {other.iterations} "
        f"iterations of {other.per_iteration:.2f} s ({other.evaluations} evaluations "
        f"of all turns); it {ended} at a cost of {other.cost:.0f}"
    )
    scaled = other.per_iteration * whole / other.simulated
    full, own = scaled * other.iterations, warm / found.iterations
    print(
        f"all {whole:.1f} s of motion by scipy: {scaled:.1f} s of CPU an iteration, "
        f"{full:.0f} s for {other.iterations}; one fit here: {warm:.2f} s of CPU, "
        f"{own:.2f} s an iteration. Ratio {scaled / own:.0f} an iteration, "
        f"{full / warm:.0f} a fit (target: 20)"
    )


if __name__ == "__main__":
    main()
