"""Reproduce tables and figures of the thesis: printed and computed values, drawings."""

from .registry import reproduce as reproduce, TARGETS as TARGETS
