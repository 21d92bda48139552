"""The parametric forms that may replace a free function.

A form is a function of a phase, or of `u`, the argument as a fraction of the range
visited; its first parameter is its size. Edges are smoothed, so that a fit can move
them.
"""

import numpy as np

from ._parametric_form import Place, Primitive, Special


# Half-width over which edges are smoothed, as a fraction of the range: the distance
# between two knots of the spline that represents a form
_EDGE = 0.004
# The same for the sine of a phase
_EDGE_OF_PHASE = 0.01
# An edge within this fraction of the range from its end may not be needed
_AT_END = 0.1
# Smallest exponent: with a smaller one, the form is a step
_FLATTEST = 0.2
# Smallest argument of a power, as a fraction of the range, so that its derivatives
# exist
_LEAST = 1e-6


def _step(at: Place, x, width=_EDGE):
    return (1 + at.xp.tanh(x / width)) / 2


def _power(at: Place, x, exponent):
    """Return `max(x, 0)**exponent`, with finite derivatives at zero."""
    seen = x > _LEAST
    return at.xp.where(seen, at.xp.where(seen, x, 1.0) ** exponent, 0.0)


def _beyond(at: Place, x, width):
    """Return the signed distance of `x` from the interval from -width to width."""
    inside = at.xp.where(x < -width, -width, x)
    return x - at.xp.where(x > width, width, inside)


def _wrapped(x):
    return (x + np.pi) % (2 * np.pi) - np.pi


def _shares(low: float, high: float, count: int) -> tuple[float, ...]:
    return tuple(np.linspace(low, high, count).tolist())


def _without_exponent(form: Primitive) -> Special:
    """Return the special case for an exponent, the last parameter, of one."""
    return Special(form, lambda p: p[:-1])


_INSIDE = _shares(0.02, 0.98, 49)
_EVERY = _shares(0.0, 2 * np.pi, 73)[:-1]

STRAIGHT = Primitive("straight", lambda at, p: p[0] * at.u)
ABOVE = Primitive(
    "above",
    lambda at, p: p[0] * at.xp.maximum(at.u - p[1], 0.0),
    (_INSIDE,),
    (0.05,),
    places=(1,),
    apart=lambda p: 1.0 + 0.0 * p[1],
)
BELOW = Primitive(
    "below",
    lambda at, p: p[0] * at.xp.maximum(p[1] - at.u, 0.0),
    (_INSIDE,),
    (0.05,),
    places=(1,),
    apart=lambda p: 1.0 + 0.0 * p[1],
)
STEP = Primitive(
    "step",
    lambda at, p: p[0] * _step(at, at.u - p[1]),
    (_INSIDE,),
    (0.05,),
    places=(1,),
    apart=lambda p: 1.0 + 0.0 * p[1],
    sharp=True,
)
WINDOW = Primitive(
    "window",
    lambda at, p: p[0] * (_step(at, at.u - p[1]) - _step(at, at.u - p[2])),
    (_INSIDE, _INSIDE),
    (0.05, 0.05),
    places=(1, 2),
    apart=lambda p: abs(p[2] - p[1]),
    sharp=True,
    # up to a constant, one edge outside the range leaves a step at the other one
    special=(
        Special(STEP, lambda p: (p[0], p[1]), lambda p: p[2] > 1 - _AT_END),
        Special(STEP, lambda p: (-p[0], p[2]), lambda p: p[1] < _AT_END),
    ),
)
BUMP = Primitive(
    "bump",
    lambda at, p: p[0] * at.xp.exp(-(((at.u - p[1]) / p[2]) ** 2)),
    (_INSIDE, (0.03, 0.05, 0.08, 0.12, 0.2, 0.3)),
    (0.05, 0.03),
    places=(1,),
)
SQUARE = Primitive("square", lambda at, p: p[0] * (at.u - 0.5) ** 2)
PARABOLA = Primitive(
    "parabola",
    lambda at, p: p[0] * (at.u - p[1]) ** 2,
    (_shares(0.0, 1.0, 21),),
    (0.05,),
    places=(1,),
)
CUBE = Primitive("cube", lambda at, p: p[0] * (at.u - 0.5) ** 3)
EXPONENTIAL = Primitive(
    "exponential",
    lambda at, p: p[0] * at.xp.exp(p[1] * (at.u - 0.5)),
    ((-16.0, -8.0, -4.0, -2.0, 2.0, 4.0, 8.0, 16.0),),
    (1.0,),
)
POWER = Primitive(
    "power",
    lambda at, p: p[0] * at.xp.maximum(at.u, _LEAST) ** p[1],
    ((0.5, 1.5, 2.0, 3.0),),
    (0.2,),
    limits=((1, _FLATTEST),),
    special=(_without_exponent(STRAIGHT),),
)
SETTLING = Primitive(
    "settling",
    lambda at, p: p[0] * (1 - at.xp.exp(-p[1] * at.u)),
    ((0.5, 1.0, 2.0, 4.0, 8.0, 16.0),),
    (1.0,),
    limits=((1, 0.0),),
)
CURVED_ABOVE = Primitive(
    "curved above",
    lambda at, p: p[0] * _power(at, at.u - p[1], p[2]),
    (_shares(0.05, 0.9, 35), (1.5, 2.0, 3.0)),
    (0.05, 0.2),
    places=(1,),
    limits=((2, _FLATTEST),),
    special=(_without_exponent(ABOVE),),
    apart=lambda p: 1.0 + 0.0 * p[1],
)
CURVED_BELOW = Primitive(
    "curved below",
    lambda at, p: p[0] * _power(at, p[1] - at.u, p[2]),
    (_shares(0.1, 0.95, 35), (1.5, 2.0, 3.0)),
    (0.05, 0.2),
    places=(1,),
    limits=((2, _FLATTEST),),
    special=(_without_exponent(BELOW),),
    apart=lambda p: 1.0 + 0.0 * p[1],
)
DEAD_ZONE = Primitive(
    "dead zone",
    lambda at, p: p[0] * _beyond(at, at.u - p[1], p[2]),
    (_shares(0.2, 0.8, 25), _shares(0.04, 0.4, 10)),
    (0.05, 0.05),
    places=(1,),
    limits=((2, 0.0),),
    ends=lambda p: (p[1] - p[2], p[1] + p[2]),
    apart=lambda p: 2 * abs(p[2]),
    special=(
        Special(ABOVE, lambda p: (p[0], p[1] + p[2]), lambda p: p[1] - p[2] < _AT_END),
        Special(
            BELOW, lambda p: (-p[0], p[1] - p[2]), lambda p: p[1] + p[2] > 1 - _AT_END
        ),
    ),
)
SATURATING = Primitive(
    "saturating",
    lambda at, p: p[0] * at.xp.tanh((at.u - p[1]) / p[2]),
    (_INSIDE, (0.05, 0.1, 0.2, 0.4)),
    (0.05, 0.05),
    places=(1,),
    limits=((2, _EDGE),),
)
WAVE = Primitive(
    "wave",
    lambda at, p: p[0] * at.xp.cos(2 * np.pi * p[1] * at.u - p[2]),
    (_shares(0.75, 8.0, 30), _EVERY[::3]),
    (0.1, 0.3),
)
# the derivative of a bump: the force of a potential well or barrier
DETENT = Primitive(
    "detent",
    lambda at, p: (
        p[0] * (at.u - p[1]) / p[2] * at.xp.exp(0.5 - ((at.u - p[1]) / p[2]) ** 2 / 2)
    ),
    (_INSIDE, (0.03, 0.05, 0.08, 0.12, 0.2, 0.3)),
    (0.05, 0.03),
    places=(1,),
    limits=((2, _EDGE),),
)
DRY = Primitive("dry", lambda at, p: p[0] + 0.0 * at.u, odd=True)
FORWARD = Primitive("forward", lambda at, p: p[0] / 2 + 0.0 * at.u, jump=0.5)
BACKWARD = Primitive("backward", lambda at, p: p[0] / 2 + 0.0 * at.u, jump=-0.5)
FALLING = Primitive(
    "falling",
    lambda at, p: p[0] * at.xp.exp(-((at.v / p[1]) ** 2)),
    ((0.03, 0.05, 0.08, 0.12, 0.2, 0.3, 0.5),),
    (0.05,),
    odd=True,
)
FAST = Primitive(
    "fast",
    lambda at, p: p[0] * _power(at, at.xp.abs(at.v) - p[1], 1.0),
    (_shares(0.02, 0.46, 23),),
    (0.05,),
    odd=True,
    # width of the range between the thresholds of both directions
    ends=lambda p: (2 * p[1],),
)
POWER_OF_SPEED = Primitive(
    "power of speed",
    lambda at, p: p[0] * _power(at, 2 * at.xp.abs(at.v), p[1]),
    ((0.5, 1.5, 2.0, 3.0, 4.0),),
    (0.2,),
    odd=True,
    limits=((1, _FLATTEST),),
)
HARMONICS = tuple(
    Primitive(
        f"harmonic {n}",
        lambda at, p, n=n: p[0] * at.xp.cos(n * at.x - p[1]),
        (_EVERY[::3],),
        (0.3,),
    )
    for n in (1, 2, 3)
)
HALF_TURN = Primitive(
    "half turn",
    lambda at, p: p[0] * _step(at, at.xp.sin(at.x - p[1]), _EDGE_OF_PHASE),
    (_EVERY,),
    (0.1,),
    apart=lambda p: 0.5 + 0.0 * p[1],
    sharp=True,
)
ARC = Primitive(
    "arc",
    lambda at, p: (
        p[0] * _step(at, at.xp.cos(at.x - p[1]) - at.xp.cos(p[2]), _EDGE_OF_PHASE)
    ),
    (_EVERY, _shares(0.2, 2.9, 19)),
    (0.1, 0.1),
    apart=lambda p: abs(p[2]) / np.pi,
    sharp=True,
)
BUMP_IN_TURN = Primitive(
    "bump in turn",
    lambda at, p: p[0] * at.xp.exp(-((_wrapped(at.x - p[1]) / p[2]) ** 2)),
    (_EVERY, (0.1, 0.15, 0.2, 0.3, 0.5, 0.8)),
    (0.1, 0.1),
)

ON_A_LINE = (
    STRAIGHT,
    ABOVE,
    BELOW,
    STEP,
    WINDOW,
    BUMP,
    SQUARE,
    CUBE,
    EXPONENTIAL,
    WAVE,
    CURVED_ABOVE,
    CURVED_BELOW,
    DEAD_ZONE,
    SATURATING,
)
FROM_ZERO = (POWER,)
OF_TIME = (SETTLING,)
# the rig parameters represent a force that is linear in the position, but not such a
# force times a factor
OF_FACTORS = (PARABOLA,)
OF_POSITION = (DETENT,)
OF_SPEED = (FORWARD, BACKWARD, FALLING, FAST, POWER_OF_SPEED)
# dry friction alone is a named term
ONLY_IN_SUMS = (DRY,)
OF_PHASE = (*HARMONICS, HALF_TURN, ARC, BUMP_IN_TURN)

PRIMITIVES = (
    *ON_A_LINE,
    *OF_SPEED,
    *OF_PHASE,
    *FROM_ZERO,
    *OF_TIME,
    *OF_FACTORS,
    *ONLY_IN_SUMS,
    *OF_POSITION,
)
"""All forms, in the order of their indices in a compiled program."""
MOST_NUMBERS = max(one.count for one in PRIMITIVES)
"""Largest number of parameters of a form that is not a sum."""
