"""Score the sealed cases: compare the verdicts of docs/sealed with the keys.

The keys were published after the verdicts, and their SHA-256 had been announced before;
the script rejects any other file. It prints one table row per case, and the score.

    python -m benchmarks.sealed KEYS.json [--verdicts docs/sealed/verdicts.json]
"""

import argparse
import hashlib
import json
from pathlib import Path


# announced before the verdicts were made
ANNOUNCED = "b325e7e4dc2082498320961c9ce65df65c319d6a59767212f9791ea104cf4b01"
# effects that have a name; for all others, `unknown` is correct
NAMED = {
    "viscous_damping",
    "coulomb_friction",
    "quadratic_drag",
    "nonlinear_spring",
    "restitution_velocity",
    "drive_ripple",
    "cam_profile_error",
    "sensor_lag",
    "external_vibration",
}


def read_keys(file: Path) -> dict[str, dict]:
    """The true effects of each case, with their parameters.

    **Raises:** `ValueError` if the file is not the one announced.
    """
    data = file.read_bytes()
    found = hashlib.sha256(data).hexdigest()
    if found != ANNOUNCED:
        raise ValueError(f"{file}: its SHA-256 is {found}, announced was {ANNOUNCED}.")
    return {
        key["case"]: {e["effect"]: e["parameters"] for e in key["effects"]}
        for key in json.loads(data)
    }


def said(verdict: dict) -> dict:
    """The effects that a verdict names, with their parameters."""
    return {e["name"]: e["parameters"] for e in verdict["effects"]}


def right(truth: dict, verdict: dict) -> bool:
    """Whether the verdict names exactly the true effects.

    If one of them has no name, `unknown` is correct.
    """
    if not truth:
        return verdict["verdict"] == "none"
    if set(truth) - NAMED:
        return verdict["verdict"] == "unknown"
    return verdict["verdict"] == "effect" and set(said(verdict)) == set(truth)


def strengths(truth: dict, verdict: dict) -> list[tuple[str, float, float, float]]:
    """Parameter, true value, estimate and standard error of the effects in both key and
    verdict.

    The keys do not give the phase of a vibration.
    """
    return [
        (parameter, true, value[parameter]["value"], value[parameter]["stderr"])
        for name, value in said(verdict).items()
        for parameter, true in truth.get(name, {}).items()
        if parameter in value
    ]


def line(case: str, truth: dict, verdict: dict) -> str:
    """A row of the table."""
    named = ", ".join(said(verdict)) or verdict["verdict"]
    if verdict["verdict"] == "unknown":
        named = "unknown"
    numbers = "; ".join(
        f"{p} {true:.4g}, found {value:.4g} ± {stderr:.1g}"
        for p, true, value, stderr in strengths(truth, verdict)
    )
    mark = "yes" if right(truth, verdict) else "**no**"
    return (
        f"| {case} | {', '.join(truth) or 'nothing'} | {named} | {mark} | {numbers} |"
    )


def main(arguments: argparse.Namespace) -> None:
    """Print the table and the score."""
    truths = read_keys(arguments.keys)
    verdicts = {v["case"]: v for v in json.loads(arguments.verdicts.read_text("utf-8"))}
    print("| case | truth | verdict | right | strengths |\n|---|---|---|---|---|")
    off = []
    for case, truth in truths.items():
        print(line(case, truth, verdicts[case]))
        off += [abs(v - t) / s for _, t, v, s in strengths(truth, verdicts[case])]
    score = sum(right(truth, verdicts[case]) for case, truth in truths.items())
    print(f"\n{score} of {len(truths)} right")
    print(f"{len(off)} numbers, at most {max(off):.2g} standard errors off")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("keys", type=Path)
    parser.add_argument(
        "--verdicts", type=Path, default=Path("docs/sealed/verdicts.json")
    )
    main(parser.parse_args())
