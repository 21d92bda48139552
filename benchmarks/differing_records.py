"""Test whether a parameter that differs from recording to recording is found.

A rig of `docs/rigs` is drawn at random within its tolerances. One of its parameters has
a different value in each of four recordings; the four values are equally spaced.

    python -m benchmarks.differing_records two_stops damping_over_mass 0.05
"""

import argparse
import time

import numpy as np

from benchmarks._own_rig_makers import Accumulates, made_case, MAKERS
from benchmarks.own_rigs import drawn, RIGS
from jaxcam.discrepancy import diagnose
from jaxcam.fitting import read_setup


RECORDS = 4


def recordings_of(rig: str, setup, name: str, step: float, seed: int):
    """Return the values of the parameter, and one recording with each of them."""
    rng = np.random.default_rng(seed)
    while True:
        truth = drawn(setup, rng)
        places = np.arange(RECORDS) - (RECORDS - 1) / 2
        values = truth[name] * (1 + step * places)
        try:
            runs = [
                made_case(rig, setup, truth | {name: value}, rng, ())[k][0]
                for k, value in enumerate(values)
            ]
        except Accumulates:
            continue
        return values, runs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rig", choices=sorted(MAKERS))
    parser.add_argument("parameter")
    parser.add_argument("step", type=float, help="relative difference of the values")
    parser.add_argument("--seed", type=int, default=5)
    args = parser.parse_args()
    setup = read_setup(RIGS / f"{args.rig}.toml")
    true, runs = recordings_of(args.rig, setup, args.parameter, args.step, args.seed)
    begun = time.process_time()
    found = diagnose(setup, runs)
    spent = time.process_time() - begun
    print(f"{found.verdict}: {found.summary} [{spent:.0f} s of CPU]")
    print(f"true {args.parameter}: {', '.join(f'{value:.6g}' for value in true)}")
    if found.differing is None:
        print("no parameter differs")
        return
    print(f"found {found.differing.name}, residual {found.differing.left:.3f} noises:")
    for name, value, stderr in zip(
        found.differing.records, found.differing.values, found.differing.stderr
    ):
        print(f"  {name}: {value:.6g} +- {stderr:.1g}")


if __name__ == "__main__":
    main()
