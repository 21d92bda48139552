"""Figure 5.8: complete and incomplete chatter."""

from ..releases import released_target


TARGET = released_target(
    "Complete and incomplete chatter", (151.0, 1), (153.5, 0), (153.9, 0)
)
