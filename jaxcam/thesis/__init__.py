"""Tables and figures of the thesis: printed values, computed ones, drawings."""

from .registry import reproduce as reproduce, TARGETS as TARGETS
