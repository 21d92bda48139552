"""Small recordings and an example of a user-defined rig, shipped with the package.

The cam-follower recordings are simulated; those of the pendulum are real.
"""

from pathlib import Path


DEMO_RIG = Path(__file__).parent / "demo_rig"
"""A case folder with three simulated recordings and a rig file (`make_demo.py`)."""

PENDULUM = Path(__file__).parent / "pendulum"
"""A case folder with two real recordings and a rig file (`pendulum/SOURCE.md`)."""

NEW_RIG = Path(__file__).parent / "new_rig"
"""A system in Python and its rig file, to be copied and edited (`jaxcam new-rig`)."""
