"""Write a parametric form as a formula and in words."""

import math
from collections.abc import Mapping

import numpy as np

from ..terms import Factor, Family, Primitive, unit_along, Variable, Where
from ._words import quantity


# Formulas in terms of the argument x. Their other placeholders are sizes, slopes,
# positions, lengths and phases, which `_values` computes from the fitted parameters.
_FORMULAS = {
    "straight": "{slope}*({x} - {low})",
    "above": "{slope}*max({x} - {a}, 0)",
    "below": "{slope}*max({a} - {x}, 0)",
    "step": "{size}*({x} > {a})",
    "window": "{size}*({a} < {x})*({x} < {b})",
    "bump": "{size}*exp(-(({x} - {a})/{width})**2)",
    "square": "{bend}*({x} - {middle})**2",
    "parabola": "{bend}*({x} - {a})**2",
    "cube": "{third}*({x} - {middle})**3",
    "exponential": "{size}*exp(({x} - {middle})/{reach})",
    "power": "{size}*({x}/{range})**{power}",
    "settling": "{size}*(1 - exp(-({x} - {low})/{span}))",
    "wave": "{size}*cos({wavenumber}*({x} - {low}) - {lead})",
    "dry": "{size}*sign({x})",
    "forward": "{size}*({x} > 0)",
    "backward": "{size}*({x} < 0)",
    "falling": "{size}*sign({x})*exp(-({x}/{decay})**2)",
    "curved above": "{size}*(max({x} - {a}, 0)/{range})**{exponent}",
    "curved below": "{size}*(max({a} - {x}, 0)/{range})**{exponent}",
    "dead zone": "{slope}*(max({x} - {right}, 0) - max({left} - {x}, 0))",
    "saturating": "{size}*tanh(({x} - {a})/{width})",
    "detent": "{size}*({x} - {a})/{width}*exp(0.5 - (({x} - {a})/{width})**2/2)",
    "fast": "{slope}*sign({x})*max(abs({x}) - {edge}, 0)",
    "power of speed": "{size}*sign({x})*abs({x}/{half_range})**{power}",
    "harmonic 1": "{size}*cos({x} - {turn})",
    "harmonic 2": "{size}*cos(2*{x} - {turn})",
    "harmonic 3": "{size}*cos(3*{x} - {turn})",
    "half turn": "{size}*(sin({x} - {turn}) > 0)",
    "arc": "{size}*(cos({x} - {turn}) > {rim})",
    "bump in turn": "{size}*exp(-(wrapped({x} - {turn})/{half})**2)",
}
_WORDS = {
    "straight": "grows with the {x}",
    "above": "acts only above {x} {a}{unit}, and grows from there",
    "below": "acts only below {x} {a}{unit}, and grows from there",
    "step": "sets in at {x} {a}{unit}",
    "window": "acts only between {x} {a} and {b}{unit}",
    "bump": "acts only around {x} {a}{unit}, over about {width}{unit}",
    "square": "grows with the square of the {x}, measured from {middle}{unit}",
    "parabola": "grows with the square of the distance from {x} {a}{unit}",
    "cube": "grows with the cube of the {x}, measured from {middle}{unit}",
    "exponential": "{trend} exponentially with the {x}, by a factor e over "
    "{span}{unit}",
    "power": "grows as the {x} to the power {power}",
    "settling": "settles exponentially with the {x}, over {span}{unit}",
    "wave": "oscillates with the {x}, with a wavelength of {wavelength}{unit}",
    "dry": "has a constant size and the direction of the {x}",
    "forward": "acts only while the {x} is positive",
    "backward": "acts only while the {x} is negative",
    "falling": "opposes the motion near rest and decreases with the {x}, over about "
    "{decay}{unit}",
    "curved above": "acts only above {x} {a}{unit}, and grows from there with "
    "the power {exponent} of the distance",
    "curved below": "acts only below {x} {a}{unit}, and grows from there with "
    "the power {exponent} of the distance",
    "dead zone": "does not act between {x} {left} and {right}{unit}, and grows "
    "beyond them",
    "saturating": "changes with the {x} around {a}{unit}, over about {width}{unit}, "
    "and saturates",
    "detent": "{pulls} {x} {a}{unit}, most strongly at a distance of {width}{unit}",
    "fast": "acts only where the speed exceeds {edge}{unit}, and grows from there",
    "power of speed": "grows as the speed to the power {power}",
    "harmonic 1": "varies once per cycle",
    "harmonic 2": "varies twice per cycle",
    "harmonic 3": "varies three times per cycle",
    "half turn": "acts in one half of each cycle, from {x} {turn}{unit}",
    "arc": "acts only in part of each cycle, around {x} {turn}{unit}, over "
    "+-{half}{unit}",
    "bump in turn": "acts only around {x} {turn}{unit} in each cycle, over about "
    "{half}{unit}",
}
_THINGS = {
    "force": "a force",
    "restitution": "a coefficient of restitution",
    "surface": "a surface error",
    "sensor": "a sensor error",
}
# typical causes of a sensor error
_FAULTS = {
    Variable.POSITION: "as from a scale with uneven graduation or an eccentric encoder",
    Variable.PHASE: "as from a disturbance synchronous with the drive",
    Variable.TIME: "as from a sensor that drifts",
}
# angles that are negative by at most this (rad) are not written as just below 2 pi
_BELOW_ZERO = 0.05
_FACTORS = {
    Factor.VELOCITY: ("velocity", "damping"),
    Factor.DIRECTION: ("sign(velocity)", "dry friction"),
}


def formula_of(
    family: Family, primitive: Primitive, numbers: np.ndarray, kind: str
) -> tuple[str, str]:
    """Return the formula of a function, and a sentence about it.

    **Arguments:** its family and form, the parameters of the form, and its kind
    (`"force"`, `"restitution"`, `"surface"` or `"sensor"`).
    """
    texts, sentences, mechanism = [], [], ""
    for part, own in primitive.divided(numbers):
        own = _with_positive_size(part, own)
        values = _values(family, own)
        texts.append(_FORMULAS[part.name].format(**values))
        sentence = _WORDS[part.name].format(**values)
        if kind == "restitution" and own[0] < 0:
            sentence = sentence.replace("grows", "falls").replace("decays", "recovers")
        sentences.append(sentence)
        if family.where is Where.SENSOR or not primitive.parts:
            mechanism = _mechanism(family, part, own, values)
    text = " + ".join(texts).replace("+ -", "- ")
    says = " and also ".join(sentences)
    thing = _THINGS[kind]
    if primitive.parts and family.factor is not Factor.ONE:
        text = f"({text})"
    if family.factor is Factor.DEFLECTION:
        text, thing = f"{text}*(position - {family.middle:.4g})", "a stiffness"
    elif family.factor is not Factor.ONE:
        factor, thing = _FACTORS[family.factor]
        text = f"{text}*{factor}"
    elif kind == "restitution":
        text = f"exp({text})"
    text = text.replace("- -", "+ ")
    text = text.replace(f"({_name(family)} - 0)", _name(family))
    return text, f"{thing} that {says}: {text}{mechanism}"


def _with_positive_size(form: Primitive, numbers: np.ndarray) -> np.ndarray:
    """Return the parameters of an oscillation with a positive amplitude and a positive
    wave number.
    """
    kind = form.name.split()[0]
    if kind not in ("wave", "harmonic"):
        return numbers
    size, *others, phase = numbers
    if kind == "wave" and others[0] < 0:
        others, phase = [-others[0]], -phase
    if size < 0:
        size, phase = -size, phase + math.pi
    return np.array([size, *others, phase])


def _values(family: Family, numbers: np.ndarray) -> Mapping[str, str]:
    """Return all values that a formula may contain, in the units of the argument."""
    low, width = family.low, family.high - family.low
    size, first, second = (*map(float, numbers), 0.0, 0.0)[:3]
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
        "exponent": second,
        "left": low + (first - second) * width,
        "right": low + (first + second) * width,
        "edge": first * width,
        "half_range": width / 2,
        "reach": width / first if first else math.inf,
        "span": width / abs(first) if first else math.inf,
        "decay": abs(first) * width,
        "wavenumber": 2 * math.pi * first / width,
        "wavelength": width / first if first else math.inf,
        "lead": _turned(second),
        "turn": _turned(first),
        "rim": math.cos(second),
        "half": abs(second),
    }
    unit = unit_along(family.argument, family.motion_unit)
    words = {
        "x": _name(family),
        "trend": "decays" if first < 0 else "grows",
        "pulls": "pulls towards" if size < 0 else "pushes away from",
        "unit": quantity("", unit),
    }
    return {name: f"{value:.4g}" for name, value in shown.items()} | words


def _name(family: Family) -> str:
    """Return the name of the argument in a formula."""
    return "speed" if family.argument is Variable.APPROACH else str(family.argument)


def _turned(angle: float) -> float:
    """Return an angle between 0 and 2 pi, or just below zero."""
    return (angle + _BELOW_ZERO) % (2 * math.pi) - _BELOW_ZERO


def _mechanism(family: Family, primitive: Primitive, numbers, values) -> str:
    """Describe the mechanism that typically causes such a function, if one is known."""
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
            f"; it pushes back {side} {values['a']} {unit} with a stiffness of "
            f"{stiffness}, as an elastic stop would"
        )
    return f"; it pulls {side} {values['a']} {unit} with a stiffness of {stiffness}"
