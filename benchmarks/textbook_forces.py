"""Recover forces of textbook oscillators, and compare with a regression on derivatives.

A Duffing oscillator with the natural frequency and hardening of the Silverbox, two
Bouc-Wen oscillators (the published benchmark and one whose loop saturates), and the
same Duffing oscillator below a stop are driven by a known multisine. Only the position
is measured, with noise. Both methods get three recordings; a fourth is held out.

- `jaxcam` gets a linear oscillator with tolerances, and `diagnose` finds what it lacks.
- `pysindy` (optional: `pip install pysindy`) uses the settings with the best free run
  of the last of the three recordings (see `_textbook_sindy.py`). With a stop, it is run
  twice: as it is, and with derivatives taken within flights and the true impact law.

The error of the force is the rms error of the model's acceleration along the true
held-out motion, divided by the rms of the force that no linear oscillator has. The
error of the free run of the held-out recording, from its first 20 samples and its
input, is in units of the rms of the position. The last line of a case is the free run
of the true system.

    python -m benchmarks.textbook_forces duffing
    python -m benchmarks.textbook_forces bouc_wen --snr 100 --elements 2
    python -m benchmarks.textbook_forces duffing_stop --tools pysindy
"""

import argparse
import math
import time
from typing import Any

import numpy as np

from benchmarks._textbook_cases import (
    acceleration,
    Case,
    CASES,
    extra_force,
    measured,
    Motion,
    motions,
)
from benchmarks._textbook_runs import error_of, force_error, run_freely


# Seed of the noise of the held-out recording
_HELD = 99


def reported(name: str, force: float, free: float, seconds: float | None = None):
    """Print the errors of one model."""
    spent = "" if seconds is None else f", {seconds:.0f} s of CPU"
    print(f"  {name}: force {force:.4f}, free run {free:.5f}{spent}", flush=True)


def by_diagnosis(case: Case, learnt, held: Motion, noise: float, args) -> None:
    """Diagnose a linear oscillator, and test the result on the held-out motion."""
    from benchmarks._textbook_diagnosis import Found, recording, setup_of

    runs = [
        recording(f"run{k + 1}", one, measured(one, noise, k))
        for k, one in enumerate(learnt)
    ]
    unseen = recording("held_out", held, measured(held, noise, _HELD))
    begun = time.time()

    def report(sentence, fraction):
        if args.progress and fraction is None:
            print(f"  [{time.time() - begun:.0f} s] {sentence}", flush=True)

    found = Found(case, setup_of(case, noise), runs, args.elements, report)
    one = found.diagnosis
    print(f"  {one.verdict}: {one.summary}")
    for function in one.missing:
        print(f"    {function.formula or function.words}")
    floor = one.noise_floor
    print(
        f"  held-out residual: {one.heldout_before / floor:.2f} noises before, "
        f"{one.heldout_after / floor:.3f} after"
    )
    for textbook in (True, False):
        name = "jaxcam, linear oscillator" if textbook else "jaxcam, diagnosed"
        force = found.acceleration(held, textbook)
        try:
            free = error_of(found.free(unseen, textbook), held.states[:, 0])
        except ValueError as error:
            print(f"    {error}")
            free = math.inf
        reported(name, _force(case, held, force), free, None if textbook else found.cpu)


def by_regression(case: Case, learnt, held: Motion, noise: float, args) -> None:
    """Fit pysindy, and test the result on the held-out motion."""
    from benchmarks._textbook_sindy import pysindy, regress

    if pysindy is None:
        print("  pysindy is not installed; `pip install pysindy` adds the comparison")
        return
    runs = [
        (one.time, measured(one, noise, k), one.input, one.impacts)
        for k, one in enumerate(learnt)
    ]
    unseen = measured(held, noise, _HELD)
    for split in (False, True) if math.isfinite(case.stop) else (False,):
        spent = time.process_time()
        found, settings, _ = regress(
            case, runs, split=split, report=print if args.progress else None
        )
        spent = time.process_time() - spent
        law: dict[str, Any] = (
            {"stop": case.stop, "restitution": case.restitution} if split else {}
        )
        run = run_freely(found.field, case.rate, held.input, unseen, **law)
        print(f"    {settings}: {found.formula}")
        reported(
            "pysindy, with the true impacts" if split else "pysindy",
            _force(case, held, found.acceleration(held.states, held.input)),
            error_of(run, held.states[:, 0]),
            spent,
        )


def _force(case: Case, held: Motion, found) -> float:
    return force_error(found, acceleration(case, held), extra_force(case, held))


def _true(case: Case, held: Motion, noise: float) -> float:
    run = run_freely(
        lambda x, u: case.field(x, 0.0, u),
        case.rate,
        held.input,
        measured(held, noise, _HELD),
        own=0 if case.memory is None else 1,
        stop=case.stop,
        restitution=case.restitution,
    )
    return error_of(run, held.states[:, 0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("case", choices=sorted(CASES))
    parser.add_argument("--snr", type=float, nargs="*", default=[1000.0, 100.0])
    parser.add_argument("--seed", type=int, default=1, help="of the inputs")
    parser.add_argument("--tools", nargs="*", default=["jaxcam", "pysindy"])
    parser.add_argument(
        "--elements",
        type=int,
        default=0,
        choices=(0, 1, 2),
        help="`Policy.elements` of the diagnosis",
    )
    parser.add_argument("--progress", action="store_true")
    args = parser.parse_args()
    case = CASES[args.case]
    learnt, held = motions(case, args.seed)
    signal = float(np.std(np.concatenate([one.states[:, 0] for one in learnt])))
    for ratio in args.snr:
        print(f"{args.case}, signal to noise {ratio:g}", flush=True)
        if "jaxcam" in args.tools:
            by_diagnosis(case, learnt, held, signal / ratio, args)
        if "pysindy" in args.tools:
            by_regression(case, learnt, held, signal / ratio, args)
        print(f"  free run of the true system: {_true(case, held, signal / ratio):.5f}")


if __name__ == "__main__":
    main()
