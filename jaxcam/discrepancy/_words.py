"""The verdict in the words of a mechanical engineer."""

from ._trials import Trial


# Rms in units of the noise up to which a model is as good as the sensors
NOISE = 1.2


def listed(names) -> str:
    names = [str(name).replace("_", " ") for name in names]
    if not names:
        return "nothing"
    if len(names) == 1:
        return names[0]
    return f"{', '.join(names[:-1])} and {names[-1]}"


def number(value: float, stderr: float, unit: str) -> str:
    unit = "" if unit == "-" else f" {unit}"
    return f"{value:.4g} +- {stderr:.1g}{unit}"


def summary_of(
    verdict,
    effects,
    unexplained,
    best: Trial,
    before: Trial,
    rig,
    least,
    units,
    fitted: float,
    unseen: float,
) -> str:
    """One or two sentences; the last two are rms in units of the noise.

    On the records that were fitted, and on those that the parameters have not seen.
    """
    if verdict == "none":
        first = next(iter(least.items()), None)
        tail = ""
        if first is not None:
            name, (size, _, _) = first
            unit = "" if units[name] == "-" else f" {units[name]}"
            tail = f" A {name} of {size:.2g}{unit} would have been seen."
        if fitted > NOISE:
            return (
                "Nothing that the records share is missing. They are not explained "
                "down to the noise of the sensors, though: what is left is "
                f"{fitted:.2g} times that, and differs from record to record.{tail}"
            )
        if unseen > NOISE:
            tail = (
                f"{tail} A part of the records does not pin the parameters down well "
                f"enough to predict the others, though: it misses by {unseen:.2g} "
                "times the noise."
            )
        return (
            "Nothing is missing: with its parameters fitted within their tolerances "
            f"the model explains all records down to the noise of the sensors.{tail}"
        )
    named = [effect for effect in effects if effect.name != "unknown"]
    parts = []
    for effect in named:
        values = ", ".join(
            f"{name} = {number(v.value, v.stderr, v.unit)}"
            for name, v in effect.parameters.items()
        )
        parts.append(f"{effect.sentence} ({values}; {effect.region})")
    if verdict == "effect":
        moved = _hidden(best, before, rig)
        return f"The model lacks {' and '.join(parts)}.{moved}"
    what = effects[0]
    more = f" It resembles {listed(e.name for e in named)} in part." if named else ""
    return (
        "Something is missing that is none of the known effects: it acts like "
        f"{what.sentence}, {what.region}.{more}"
    )


def _hidden(best: Trial, before: Trial, rig) -> str:
    """The parameter that went furthest to make up for what was missing."""
    if not best.names:
        return ""
    moved = {
        name: abs(before.fit[name].value - best.fit[name].value)
        / max(best.fit[name].stderr, 1e-300)
        for name in rig
    }
    if not moved:
        return ""
    name = max(moved, key=lambda one: moved[one])
    if moved[name] < 3:
        return ""
    return (
        f" Without it, a fit would have moved {name.replace('_', ' ')} from "
        f"{best.fit[name].value:.5g} to {before.fit[name].value:.5g}."
    )
