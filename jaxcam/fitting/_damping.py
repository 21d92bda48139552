"""Damping of the scoring steps of a fit, after accepted and rejected steps."""

from typing import NamedTuple


LEAST_DAMPING = 1e-6
"""Minimum damping, relative to the scales of the parameters."""
# Initial and maximum damping
_FIRST, _MOST = 1.0, 1e12
# Factor on the damping after a good step, and factor after a poor step or after a good
# step that follows a rejected one
_EASED, _POOR = 0.1, 0.5
# Minimum ratio of the decrease of the cost to the predicted decrease in a good step
_GOOD = 0.5
# Damping below which it is reduced in a valley
_LOW = 1e-1
# Damping of the states after the first rejected step, factor after each further one,
# and factor after an accepted step; smaller values are set to zero
_FIRST_OF_STATES, _RAISED, _LOWERED, _NONE = 1e-6, 100.0, 0.01, 1e-9


class Damping(NamedTuple):
    """The damping of the next step."""

    value: float = _FIRST
    """The damping of the parameters, relative to their scales."""
    eased: float = _EASED
    """Factor on the damping if the next step is good."""
    raised: int = 0
    """Number of steps rejected since the last accepted one."""
    states: float = 0.0
    """The damping of the states, as a fraction of their own information: with the
    parameters held, a full step of the states may still be too long."""

    @property
    def exhausted(self) -> bool:
        """Whether the damping is so large that no step can succeed."""
        return self.value > _MOST

    def accepted(self, ratio: float) -> "Damping":
        """Return the damping after an accepted step, given the ratio of the decrease of
        the cost to the predicted decrease.
        """
        good = ratio > _GOOD
        value = self.value * (self.eased if good else _POOR)
        eased = _EASED if good and not self.raised else _POOR
        states = _LOWERED * self.states
        states = states if states > _NONE else 0.0
        return Damping(max(value, LEAST_DAMPING), eased, states=states)

    def rejected(self) -> "Damping":
        """Return the damping after a rejected step."""
        raised = self.raised + 1
        states = min(max(_RAISED * self.states, _FIRST_OF_STATES), 1.0)
        return Damping(self.value * 10**raised, _POOR, raised, states)

    def in_a_valley(self) -> "Damping":
        """Return the damping where a damped step gains little and an undamped step
        much.
        """
        if self.value > _LOW:
            return self
        states = _LOWERED * self.states
        return self._replace(
            value=max(0.1 * self.value, LEAST_DAMPING),
            states=states if states > _NONE else 0.0,
        )
