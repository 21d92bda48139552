"""A form and its numbers as a formula, and as an engineer would say it."""

import math
from collections.abc import Mapping

import numpy as np

from ..terms import Factor, Family, Primitive, Variable, Where
from ._words import quantity


# In terms of the argument x: `size` of the form, `slope` and `bend` of it by x, places
# `a` and `b` on its axis, lengths along it, and numbers of a phase.
_FORMULAS = {
    "straight": "{slope}*({x} - {low})",
    "above": "{slope}*max({x} - {a}, 0)",
    "below": "{slope}*max({a} - {x}, 0)",
    "step": "{size}*({x} > {a})",
    "window": "{size}*({a} < {x})*({x} < {b})",
    "bump": "{size}*exp(-(({x} - {a})/{width})**2)",
    "square": "{bend}*({x} - {middle})**2",
    "cube": "{third}*({x} - {middle})**3",
    "exponential": "{size}*exp(({x} - {middle})/{reach})",
    "power": "{size}*({x}/{range})**{power}",
    "wave": "{size}*cos({wavenumber}*({x} - {low}) - {lead})",
    "forward": "{size}*({x} > 0)",
    "falling": "{size}*sign({x})*exp(-({x}/{decay})**2)",
    "harmonic 1": "{size}*cos({x} - {turn})",
    "harmonic 2": "{size}*cos(2*{x} - {turn})",
    "harmonic 3": "{size}*cos(3*{x} - {turn})",
    "half turn": "{size}*(sin({x} - {turn}) > 0)",
    "arc": "{size}*(cos({x} - {turn}) > {rim})",
    "bump in turn": "{size}*exp(-(wrapped({x} - {turn})/{half})**2)",
}
_WORDS = {
    "straight": "grows with the {x}",
    "above": "acts above {x} {a} only, and grows from there",
    "below": "acts below {x} {a} only, and grows from there",
    "step": "sets in at {x} {a}",
    "window": "acts between {x} {a} and {b} only",
    "bump": "is felt around {x} {a} only, over some {width}",
    "square": "grows with the square of the {x} from {middle}",
    "cube": "grows with the cube of the {x} from {middle}",
    "exponential": "grows exponentially with the {x}, e-fold over {reach}",
    "power": "grows as the {x} to the power {power}",
    "wave": "comes and goes with the {x}, once in {wavelength}",
    "forward": "acts while the {x} is positive only",
    "falling": "opposes the motion at rest and fades with the {x}, over some {decay}",
    "harmonic 1": "comes and goes once a turn",
    "harmonic 2": "comes and goes twice a turn",
    "harmonic 3": "comes and goes three times a turn",
    "half turn": "acts in one half of each turn, from {x} {turn} on",
    "arc": "acts in a part of each turn only, around {x} {turn}, over +-{half}",
    "bump in turn": "is felt around {x} {turn} of each turn only, over some {half}",
}
_THINGS = {
    "force": "a force",
    "restitution": "a restitution",
    "surface": "a surface",
    "sensor": "an error of the sensor",
}
# what an engineer knows an error of a sensor by
_FAULTS = {
    Variable.POSITION: "as of a scale with uneven graduation or an encoder off centre",
    Variable.PHASE: "as of something picked up in step with the drive",
    Variable.TIME: "as of a sensor that drifts",
}
_FACTORS = {
    Factor.VELOCITY: ("velocity", "damping"),
    Factor.DIRECTION: ("sign(velocity)", "dry friction"),
}


def formula_of(
    family: Family, primitive: Primitive, numbers: np.ndarray, kind: str
) -> tuple[str, str]:
    """The formula of a function, and a sentence about it.

    **Arguments:** its family and form, the numbers of the form, and the kind of thing
    that it is (`"force"`, `"restitution"`, `"surface"` or `"sensor"`).
    """
    values = _values(family, numbers)
    text = _FORMULAS[primitive.name].format(**values)
    thing = _THINGS[kind]
    if family.factor is Factor.DEFLECTION:
        text, thing = f"{text}*(position - {family.middle:.4g})", "a stiffness"
    elif family.factor is not Factor.ONE:
        factor, thing = _FACTORS[family.factor]
        text = f"{text}*{factor}"
    elif kind == "restitution":
        text = f"exp({text})"
    says = _WORDS[primitive.name].format(**values)
    if kind == "restitution" and numbers[0] < 0:
        says = says.replace("grows", "falls")
    words = f"{thing} that {says}: {text}"
    return text, words + _mechanism(family, primitive, numbers, values)


def _values(family: Family, numbers: np.ndarray) -> Mapping[str, str]:
    """Whatever a formula may show, in the units of the argument."""
    low, width = family.low, family.high - family.low
    size, first, second = (*map(float, numbers), 0.0, 0.0)[:3]
    x = "speed" if family.argument is Variable.APPROACH else str(family.argument)
    shown = {
        "size": size,
        "slope": size / width,
        "bend": size / width**2,
        "third": size / width**3,
        "low": low,
        "middle": low + width / 2,
        "a": low + first * width,
        "b": low + second * width,
        "width": abs(second) * width,
        "range": width,
        "power": first,
        "reach": width / first if first else math.inf,
        "decay": abs(first) * width,
        "wavenumber": 2 * math.pi * first / width,
        "wavelength": width / first if first else math.inf,
        "lead": second,
        "turn": first % (2 * math.pi),
        "rim": math.cos(second),
        "half": abs(second),
    }
    return {name: f"{value:.4g}" for name, value in shown.items()} | {"x": x}


def _mechanism(family: Family, primitive: Primitive, numbers, values) -> str:
    """The mechanism that an engineer knows by such a function."""
    if family.where is Where.SENSOR and family.argument in _FAULTS:
        return f"; {_FAULTS[family.argument]}"
    if family.where is not Where.FLIGHT:
        return ""
    if family.factor is not Factor.ONE or family.argument is not Variable.POSITION:
        return ""
    size, unit = float(numbers[0]), family.motion_unit
    back = {"above": size < 0, "below": size > 0}.get(primitive.name)
    if back is None:
        return ""
    stiffness = quantity(values["slope"].lstrip("-"), "1/s^2")
    side = primitive.name
    if back:
        return (
            f"; it pushes back {side} {values['a']} {unit} with {stiffness}, as an "
            f"elastic stop would"
        )
    return f"; it pulls {side} {values['a']} {unit} with {stiffness}"
