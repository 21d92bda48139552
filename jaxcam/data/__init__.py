"""Small recordings that ship with the package."""

from pathlib import Path


#: a case folder of three runs and its rig file, made by `make_demo.py`
DEMO_RIG = Path(__file__).parent / "demo_rig"
