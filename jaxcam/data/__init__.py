"""Small recordings and an example of a rig of one's own, shipped with the package."""

from pathlib import Path


DEMO_RIG = Path(__file__).parent / "demo_rig"
"""A case folder of three runs and its rig file, made by `make_demo.py`."""

NEW_RIG = Path(__file__).parent / "new_rig"
"""A system in Python and its rig file, to be copied and changed (`jaxcam new-rig`)."""
