"""Test whether named effects are recognised, alone or beside one without a name.

The cases are made as those of `benchmarks.unnamed`, with an effect of the library
instead, or in addition. A verdict is correct if it names this effect alone, with a
strength within 15 % or two standard errors of the true one, and removes nine tenths of
the squared error above the noise on held-out data; and, if there is an unnamed effect
too, if it also models that effect by the criteria of `benchmarks.unnamed`. With
`--any`, the unnamed effect is drawn at random from those that the rig admits; there is
only one law of restitution at a time. A vibration is tested alone, because it is not
sought beside unnamed functions.

    python -m benchmarks.named stage
    python -m benchmarks.named two_stops --effects coulomb_friction --beside stop
    python -m benchmarks.named pendulum_wall --any --first 5 --cases 3
"""

import argparse
import math
import time

import numpy as np

from benchmarks._hidden_effects import EFFECTS
from benchmarks._hidden_physics import direction, Effect, force, Hidden, Scales
from benchmarks._made_rigs import made_rig, MadeRig, NAMES
from benchmarks._own_rig_makers import Accumulates
from benchmarks._verdicts import close
from benchmarks.unnamed import function_off, scales_of, SEEN, share_acting
from jaxcam.discrepancy import diagnose


_DRAWS = 40
# reference speed of restitution in the library
_IMPACT_SPEED = 0.3
# periods of a vibration in a record
_CYCLES = 201.3

# the effects as in `_hidden_effects.py`
NAMED = {
    "coulomb_friction": force((), lambda u, w, phi, t, s: -direction(w), 0.01, 0.04),
    "quadratic_drag": force((), lambda u, w, phi, t, s: -w * abs(w), 0.05, 0.2),
    "nonlinear_spring": force((), lambda u, w, phi, t, s: -(u**3), 0.1, 0.3),
    "external_vibration": force(
        (), lambda u, w, phi, t, s: np.sin(2 * np.pi * _CYCLES * t + 1.0), 0.02, 0.06
    ),
    # `s` in units of the reference speed
    "restitution_velocity": Effect(
        "restitution", (), lambda u, w, phi, t, s: -np.log1p(s), (0.03, 0.1)
    ),
}


def strength_of(name: str, hidden: Hidden) -> float | None:
    """The strength of an effect as the library defines it, or `None` for a spring."""
    size = hidden.size * hidden.scales.acceleration
    if name in ("coulomb_friction", "external_vibration"):
        return size
    if name == "quadratic_drag":
        return size / hidden.scales.velocity**2
    if name == "restitution_velocity":
        return hidden.size
    return None


def hidden_case(rig: MadeRig, effect: str, beside: str | None, seed: int):
    """A named effect, an unnamed one or `None`, the recordings and the motions.

    **Raises:** `ValueError` if in many rigs impacts accumulate, or the unnamed effect
    does not act.
    """
    rng = np.random.default_rng([seed, *effect.encode(), *(beside or "").encode()])
    for _ in range(_DRAWS):
        truth = rig.drawn(rng)
        try:
            bare = rig.made(truth, rng)
            scales = scales_of(rig, [motion for _, motion in bare])
            own = scales
            if effect == "nonlinear_spring":
                own = scales._replace(middle=rig.centre)
            if effect == "restitution_velocity":
                own = scales._replace(velocity=_IMPACT_SPEED)
            named = _sized(NAMED[effect], own, rng)
            other = None if beside is None else _sized(EFFECTS[beside], scales, rng)
            made = rig.made(truth, rng, [named] if other is None else [named, other])
        except Accumulates:
            continue
        runs, motions = map(list, zip(*made))
        without = other is None or other.effect.memory is not None
        if without or share_acting(other, motions) > SEEN:
            return named, other, runs, motions
    fails = "" if beside is None else f", or {beside} does not act"
    raise ValueError(
        f"impacts accumulate in {_DRAWS} rigs of {rig.name} with {effect}{fails}"
    )


def _sized(effect: Effect, scales: Scales, rng) -> Hidden:
    return Hidden(effect, float(rng.uniform(*effect.size)), scales)


def judged(found, effect: str, named: Hidden, other: Hidden | None, motions):
    """Whether a verdict is correct, and what it says."""
    names = [one.name for one in found.effects if one.name != "unknown"]
    said = [found.verdict, *names]
    true, strength = strength_of(effect, named), math.nan
    right = names == [effect]
    if right and true is not None:
        (one,) = (one for one in found.effects if one.name == effect)
        fitted = next(iter(one.parameters.values()))
        strength = fitted.value / true
        right = close(true, fitted.value, fitted.stderr)
    said.append(f"strength {strength:.3f} of the true one")
    wanted = [] if other is None else [other]
    right = right and len(found.missing) == len(wanted)
    for hidden, one in zip(wanted, found.missing):
        true_one, remembers = hidden.effect, hidden.effect.memory is not None
        alike = one.kind == true_one.kind
        alike = alike and set(one.arguments) == set(true_one.arguments)
        off = math.nan if remembers or not alike else function_off(one, hidden, motions)
        said.append(f"{one.kind} by {', '.join(one.arguments)} off by {off:.2f}")
        right = right and alike and (remembers or off < 0.4)
    floor = found.noise_floor
    before, after = (
        max((one / floor) ** 2 - 1, 0.0)
        for one in (found.heldout_before, found.heldout_after)
    )
    right = right and after < 0.1 * before
    return right, f"{'; '.join(said)}; {found.heldout_after / floor:.2f} noises left"


def _both_laws(named: str, unnamed: str) -> bool:
    """Whether both effects are laws of restitution."""
    return NAMED[named].kind == EFFECTS[unnamed].kind == "restitution"


def _drawn(rig: MadeRig, effect: str, seed: int) -> str:
    """The name of an effect that the rig admits; not another law of restitution."""
    both = [
        name
        for name, one in EFFECTS.items()
        if rig.admits(one) and not _both_laws(effect, name)
    ]
    rng = np.random.default_rng([seed, *f"beside {effect}".encode()])
    return both[int(rng.integers(len(both)))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rig", choices=NAMES)
    parser.add_argument("--effects", nargs="*", choices=sorted(NAMED))
    beside = parser.add_mutually_exclusive_group()
    beside.add_argument("--beside", choices=EFFECTS, help="a further, unnamed effect")
    beside.add_argument("--any", action="store_true", help="beside a random effect")
    parser.add_argument("--first", type=int, default=0, help="seed of first case")
    parser.add_argument("--cases", type=int, default=1, help="cases per effect")
    args = parser.parse_args()
    rig, count, correct = made_rig(args.rig), 0, 0
    if args.beside and not rig.admits(EFFECTS[args.beside]):
        parser.error(f"{args.rig} has nothing on which {args.beside} could act")
    alone = not (args.beside or args.any)
    for name in args.effects or NAMED:
        two_laws = args.beside and _both_laws(name, args.beside)
        if not rig.admits(NAMED[name]) or two_laws:
            continue
        if name == "external_vibration" and not alone:
            continue
        for seed in range(args.first, args.first + args.cases):
            unnamed = _drawn(rig, name, seed) if args.any else args.beside
            named, other, runs, motions = hidden_case(rig, name, unnamed, seed)
            begun, spent = time.time(), time.process_time()
            found = diagnose(rig.given, runs, case=f"{args.rig} {name} {seed}")
            good, why = judged(found, name, named, other, motions)
            count, correct = count + 1, correct + good
            print(
                f"{name}{f' and {unnamed}' if unnamed else ''} {seed}: "
                f"{'right' if good else 'WRONG'}: {why} [{time.time() - begun:.0f} s, "
                f"{time.process_time() - spent:.0f} s of CPU]\n    {found.summary}",
                flush=True,
            )
    print(f"{args.rig}: {correct} of {count} right")


if __name__ == "__main__":
    main()
