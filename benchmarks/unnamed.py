"""Test whether effects without a name are modelled.

The rigs in `docs/rigs`, or the cam-follower in `jaxcam/data/demo_rig`, are drawn at
random within their tolerances, each with one effect from `_hidden_effects.py`,
simulated by independent code, recorded through noisy sensors, and diagnosed. A verdict
is correct if it gives the kind and arguments of the hidden effect and names nothing
else, if it removes nine tenths of the squared error above the noise on held-out data,
and if, where the rig moved, the error of the function is less than four tenths of the
rms of the hidden effect, apart from what the rig parameters can represent.

    python -m benchmarks.unnamed two_stops
    python -m benchmarks.unnamed cam_follower --effects stop magnet --first 5
    python -m benchmarks.unnamed two_stops --effects wear soft_side --second-gap
"""

import argparse
import math
import time

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from benchmarks._hidden_effects import EFFECTS
from benchmarks._hidden_physics import Hidden, Scales
from benchmarks._made_rigs import made_rig, MadeRig, NAMES
from benchmarks._own_rig_makers import Accumulates, MAKERS, Motion
from jaxcam.discrepancy import diagnose, Diagnosis, Policy


# An effect must act in more than this fraction of the samples or impacts
SEEN = 0.05
# Maximum number of rigs in which an effect is tried
_DRAWS = 40
_AT_IMPACTS = ("restitution", "surface")  # kinds that belong to a constraint


def scales_of(rig: MadeRig, motions: list[Motion]) -> Scales:
    """The motion of a rig without an effect."""
    states = np.concatenate([one.states for one in motions])
    x, v = states[:, 0], states[:, 1]
    middle, reach = (x.max() + x.min()) / 2, (x.max() - x.min()) / 2
    steps = np.concatenate([np.gradient(m.states[:, 1], m.time) for m in motions])
    return Scales(
        float(middle),
        float(reach),
        float(np.quantile(np.abs(v), 0.995)),
        1.5 * float(np.median(np.abs(steps))),
        rig.noise,
        rig.duration,
        float(np.mean([one.hertz for one in motions])),
    )


def hidden_case(rig: MadeRig, effect: str, seed: int):
    """An effect of random size in a rig drawn at random, and its recordings.

    Rigs in which the effect hardly ever acts are redrawn.

    **Returns:** the effect, the recordings, the underlying motions, and the rig.

    **Raises:** `ValueError` if the effect acts in none of many rigs.
    """
    rng = np.random.default_rng([seed, *effect.encode()])
    for _ in range(_DRAWS):
        truth = rig.drawn(rng)
        try:
            bare = rig.made(truth, rng)
            scales = scales_of(rig, [motion for _, motion in bare])
            one = EFFECTS[effect]
            hidden = Hidden(one, float(rng.uniform(*one.size)), scales)
            made = rig.made(truth, rng, (hidden,))
        except Accumulates:
            continue
        runs, motions = map(list, zip(*made))
        if one.memory is not None or share_acting(hidden, motions) > SEEN:
            return hidden, runs, motions, truth
    raise ValueError(f"{effect} acts in none of {_DRAWS} rigs of {rig.name}")


def share_acting(hidden: Hidden, motions: list[Motion]) -> float:
    """Share of the samples, or impacts, at which an effect differs from its usual
    value by a twentieth of its range or more."""
    _, true, _ = _along(hidden, motions)
    if not true.size or np.ptp(true) == 0:
        return 0.0
    return float(np.mean(np.abs(true - np.median(true)) > np.ptp(true) / 20))


def function_off(found, hidden: Hidden, motions: list[Motion]) -> float:
    """RMS error of a function relative to the rms of the hidden effect, where the rig
    moved.
    """
    places, true, known = _along(hidden, motions)
    places["phase"] = np.mod(places["phase"], 2 * np.pi)
    table = RegularGridInterpolator(
        found.grid,
        found.value,
        bounds_error=False,
        fill_value=None,  # pyright: ignore
    )
    value = table(np.stack([places[name] for name in found.arguments], axis=1))
    if hidden.effect.kind == "restitution":
        value = np.log(value)
    basis, _ = np.linalg.qr(np.stack(known, axis=1))
    true, value = (one - basis @ (basis.T @ one) for one in (true, value))
    return float(np.sqrt(np.mean((value - true) ** 2) / np.mean(true**2)))


def _along(hidden: Hidden, motions: list[Motion]):
    """Arguments and values of an effect along the motions, and the part a rig may
    represent.
    """
    if hidden.effect.kind in _AT_IMPACTS:
        rows = np.concatenate([one.struck for one in motions])
        time, speed, angle = rows.T
        none = np.zeros(len(time))
        places = {"time": time, "phase": angle, "speed": speed}
        true = hidden.at(none, none, angle, time, speed / hidden.scales.velocity)
        known = [np.ones(len(time))]
    else:
        states = np.concatenate([one.states[::7] for one in motions])
        time = np.concatenate([one.time[::7] for one in motions])
        angle = np.concatenate([one.angle[::7] for one in motions])
        x, v = states[:, 0], states[:, 1]
        places = {"time": time, "phase": angle, "position": x, "velocity": v}
        true = hidden.at(x, v, angle, time)
        known = [np.ones(len(time)), x, v]
    return places, true, known


def judged(found: Diagnosis, hidden: Hidden, motions) -> tuple[bool, str]:
    """Whether a verdict is correct, and why."""
    effect = hidden.effect
    named = [one.name for one in found.effects]
    alike = [
        one
        for one in found.missing
        if one.kind == effect.kind and set(one.arguments) == set(effect.arguments)
    ]
    floor = found.noise_floor**2
    before, after = found.heldout_before**2 - floor, found.heldout_after**2 - floor
    left = max(after, 0.0) / max(before, 1e-300)
    stated = " and ".join(
        f"{one.kind} by {', '.join(one.arguments)}" for one in found.missing
    )
    said = [found.verdict, *named, stated]
    off = math.nan
    if alike and effect.memory is None:
        off = function_off(alike[0], hidden, motions)
    named_too = any(one not in ("unknown", "none") for one in named)
    sound = len(alike) == len(found.missing) == 1 and not named_too and left < 0.1
    right = sound and (effect.memory is not None or off < 0.4)
    above = math.sqrt(max(before, 0.0) / floor)
    return right, (
        f"{' '.join(one for one in said if one)}; {left:.3f} left of {above:.1f} "
        f"noises, function off by {off:.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rig", choices=NAMES)
    parser.add_argument("--effects", nargs="*", choices=sorted(EFFECTS))
    parser.add_argument("--first", type=int, default=0, help="seed of first case")
    parser.add_argument("--cases", type=int, default=1, help="cases per effect")
    parser.add_argument(
        "--elements",
        type=int,
        choices=(0, 1, 2),
        default=Policy().elements,
        help="`Policy.elements` of the diagnosis",
    )
    parser.add_argument(
        "--second-gap",
        action="store_true",
        help="let effects at impacts act at the second gap (two_stops)",
    )
    args = parser.parse_args()
    if args.second_gap:
        if args.rig not in MAKERS or not MAKERS[args.rig].second:
            parser.error(f"{args.rig} has no second gap of its first coordinate")
        MAKERS[args.rig] = MAKERS[args.rig].at_second_gap()
    policy = Policy(elements=args.elements)
    rig, count, right = made_rig(args.rig), 0, 0
    for name in args.effects or EFFECTS:
        if not rig.admits(EFFECTS[name]):
            continue
        for seed in range(args.first, args.first + args.cases):
            hidden, runs, motions, _ = hidden_case(rig, name, seed)
            begun, spent = time.time(), time.process_time()
            found = diagnose(
                rig.given, runs, case=f"{args.rig} {name} {seed}", policy=policy
            )
            good, why = judged(found, hidden, motions)
            count, right = count + 1, right + good
            print(
                f"{name} {seed}: {'right' if good else 'WRONG'}: {why} "
                f"[{time.time() - begun:.0f} s, {time.process_time() - spent:.0f} s of "
                f"CPU]\n    {found.summary}",
                flush=True,
            )
    print(f"{args.rig}: {right} of {count} right")


if __name__ == "__main__":
    main()
