"""Derivatives of trajectories with impacts: saltation, monodromy, local theory."""

import jaxcam as jaxcam  # 64-bit floats
