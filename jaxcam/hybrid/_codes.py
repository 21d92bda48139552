"""What a row of the log records, and how a run ended, in words."""

import enum

import equinox as eqx


class Row(enum.IntEnum):
    """The kind of one row of the log."""

    NOTHING = 0
    STEP = 1
    IMPACT = 2
    # the impact after which the remaining, infinitely many ones are summed
    LAST_IMPACT = 3
    CONTACT = 4
    RELEASE = 5
    STOP = 6


class RESULTS(eqx.Enumeration):
    """How a run ended; each item says what to do about it."""

    successful = ""
    running = (
        "The step budget ran out before t1: raise max_steps, or loosen the tolerance."
    )
    step_failed = (
        "No step was short enough: the vector field or the gap is not smooth here, or "
        "the tolerance is below rounding; loosen the tolerance or check the functions."
    )
    not_finite = (
        "The vector field, gap or impact law returned NaN or infinity: check the "
        "parameters and the state just before this time."
    )
