"""Codes for log rows, and messages for the end of a run."""

import enum
import operator

import equinox as eqx


class RowKind(enum.IntEnum):
    """The kind of event, or step, that a row of the log describes."""

    NOTHING = 0
    STEP = 1
    IMPACT = 2
    # the last simulated impact of a complete chatter; the infinitely many remaining
    # impacts are completed by a formula
    LAST_IMPACT = 3
    CONTACT = 4
    RELEASE = 5
    STOP = 6
    # the crossing of a switching surface, and the beginning and end of sliding along it
    SWITCH = 7
    SLIDE = 8
    LEAVE = 9


class _ByCode(type(eqx.Enumeration)):
    """An enumeration that is indexed by its codes as well as by its items."""

    def __getitem__(cls, item) -> str:
        known = isinstance(item, cls)
        return super().__getitem__(item if known else _ITEMS[operator.index(item)])


class RESULTS(eqx.Enumeration, metaclass=_ByCode):
    """Reasons why a run ended; each message says how to fix it.

    `RESULTS[trajectory.code]` is the message for a result code; 0 means success.

    Examples:
        >>> from jaxcam.hybrid import RESULTS
        >>> RESULTS[RESULTS.backward]
        't1 is before t0, but time runs forward: interchange them.'
    """

    successful = ""
    """The run reached t1."""
    running = (
        "The maximum number of steps was reached before t1: raise max_steps, or loosen "
        "the tolerance."
    )
    """The maximum number of steps was reached."""
    step_failed = (
        "No step was short enough: the vector field or the gap is not smooth here, or "
        "the tolerance is below the rounding error; loosen the tolerance, or check the "
        "functions."
    )
    """The integration step became too small."""
    not_finite = (
        "The vector field, gap or impact law returned NaN or infinity: check the "
        "parameters and the state just before this time."
    )
    """A function of the system returned NaN or infinity."""
    behind = (
        "A gap is negative at t0: start with every gap at zero or above, or pass "
        "state=None to start at the release point."
    )
    """A gap is negative at t0."""
    backward = "t1 is before t0, but time runs forward: interchange them."
    """t1 is before t0."""
    together = (
        "Impacts on two or more constraints accumulate, and no contact force would "
        "then hold the bodies together: choose t1 before this time, or other "
        "coefficients of restitution."
    )
    """Impacts on several constraints accumulate, and the bodies do not come to rest."""
    accumulates = (
        "Crossings of a switching surface accumulate: each flight off the surface is "
        "shorter than the last. Choose t1 before this time, or give the surface a "
        "hysteresis."
    )
    """Crossings of a switching surface accumulate."""
    painleve = (
        "Friction makes the contact force ambiguous or impossible (a Painlevé "
        "configuration): while the body slips, a contact force does not push it away "
        "from the constraint. Choose a smaller friction coefficient, or model the "
        "contact as a compliant force in the vector field."
    )
    """Because of friction, a contact force does not exist or is not unique."""


_ITEMS = (
    RESULTS.successful,
    RESULTS.running,
    RESULTS.step_failed,
    RESULTS.not_finite,
    RESULTS.behind,
    RESULTS.backward,
    RESULTS.together,
    RESULTS.accumulates,
    RESULTS.painleve,
)
(
    FINISHED,
    RUNNING,
    STEP_FAILED,
    NOT_FINITE,
    BEHIND,
    BACKWARD,
    TOGETHER,
    ACCUMULATES,
    PAINLEVE,
) = map(float, range(len(_ITEMS)))
"""Codes: the index of each item above. The status of a batch element is one of them."""


def message(code: int) -> str:
    """Return the sentence that explains a result code."""
    return RESULTS[code]
