"""Reproduce tables and figures of the thesis: printed values, computed values,
drawings.
"""

from .registry import reproduce as reproduce, TARGETS as TARGETS
