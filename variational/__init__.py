"""Derivatives of trajectories: saltation matrices."""

from ._saltation import saltation_matrix as saltation_matrix
