"""Test intervals and verdicts on user-defined rigs with known answers.

The rigs in `docs/rigs` are drawn at random within their tolerances, simulated by
independent code without hidden effects, recorded through noisy sensors, and fitted. The
script counts the cases in which the 95 % interval of each parameter contains the true
value. With `--diagnose` each case is also diagnosed, and verdicts other than `none` are
counted.

    python -m benchmarks.own_rigs two_stops --cases 100
    python -m benchmarks.own_rigs stage --cases 20 --diagnose
"""

import argparse
import time
from pathlib import Path

import numpy as np

from benchmarks._own_rig_makers import Accumulates, MAKERS, record_case
from jaxcam.discrepancy import diagnose
from jaxcam.fitting import fit, read_setup


RIGS = Path(__file__).parent.parent / "docs" / "rigs"


def drawn(setup, rng) -> dict[str, float]:
    """A random rig within the tolerances."""
    found = {}
    for one in setup.parameters:
        nominal = one.nominal
        if nominal is None:
            nominal = float(one.where(setup.model))
        found[one.name] = nominal + one.tolerance * float(rng.uniform(-1, 1))
    return found


def case_of(name: str, setup, seed: int):
    """True parameters and recordings of a case; rigs whose impacts accumulate are
    skipped.
    """
    rng = np.random.default_rng(seed)
    while True:
        truth = drawn(setup, rng)
        try:
            return truth, record_case(name, setup, truth, rng)
        except Accumulates:
            continue


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rig", choices=sorted(MAKERS))
    parser.add_argument("--cases", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="seed of first case")
    parser.add_argument("--diagnose", action="store_true")
    args = parser.parse_args()
    setup = read_setup(RIGS / f"{args.rig}.toml")
    errors: dict[str, list[float]] = {}
    wrong, begun = [], time.process_time()
    for seed in range(args.first, args.first + args.cases):
        truth, runs = case_of(args.rig, setup, seed)
        if args.diagnose:
            found = diagnose(setup, runs, case=f"{args.rig} {seed}")
            if found.verdict != "none":
                wrong.append(seed)
            print(f"{seed}: {found.verdict} {found.summary}", flush=True)
            values = {k: (v.value, v.stderr) for k, v in found.rig.items()}
        else:
            fitted = fit(setup.problem(runs))
            values = {one.name: (one.value, one.stderr) for one in fitted.estimates}
            if not fitted.converged:
                print(f"{seed}: {fitted.message}", flush=True)
        for name, true in truth.items():
            value, stderr = values[name]
            errors.setdefault(name, []).append((value - true) / stderr)
    spent = (time.process_time() - begun) / args.cases
    print(f"{args.rig}: {args.cases} cases, {spent:.1f} s of CPU each")
    for name, off in errors.items():
        inside = np.mean(np.abs(off) < 1.96)
        print(
            f"  {name:32s} {inside:6.1%} inside, mean {np.mean(off):+.2f}, "
            f"spread {np.std(off):.2f} standard errors"
        )
    if args.diagnose:
        print(f"  not `none`: {len(wrong)} of {args.cases} {wrong}")


if __name__ == "__main__":
    main()
