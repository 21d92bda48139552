"""Small recordings, and an example of a rig of your own, shipped with the package.

The cam-follower recordings are simulated; those of the pendulum are real.
"""

from pathlib import Path


DEMO_RIG = Path(__file__).parent / "demo_rig"
"""A case folder of three simulated recordings and its rig file (`make_demo.py`)."""

PENDULUM = Path(__file__).parent / "pendulum"
"""A case folder of two real recordings and its rig file (`pendulum/SOURCE.md`)."""

NEW_RIG = Path(__file__).parent / "new_rig"
"""A system in Python and its rig file, to be copied and changed (`jaxcam new-rig`)."""
