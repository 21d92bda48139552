"""Commands warn of a corner in a user's own system, and of no other."""

import driven_wall
import pytest
from typer.testing import CliRunner

from jaxcam.cli import app
from jaxcam.cli._choices import SYSTEMS
from jaxcam.cli._corner_warning import warn_of_corners
from jaxcam.cli._parameters import make_model
from jaxcam.cli._source import Source
from jaxcam.fitting import read_setup
from jaxcam.fitting.own_systems import system_class


SMOOTH = "self.stiffness * state[0]"
KINKED = "self.stiffness * jnp.maximum(state[0], 0.001)"
SWITCHED = """
import jax.numpy as jnp
from jaxcam.hybrid import SwitchedSystem


class Soft(SwitchedSystem):
    state_names = ("position", "velocity")

    def switching(self, t, state):
        return state[0]

    def branch(self, t, state, sides):
        press = jnp.where(sides[0] < 0, state[0], 0.0)
        return jnp.stack([state[1], -press - state[0]])
"""
# what a user sees, whose types nothing checks
pytestmark = pytest.mark.usefixtures("unchecked_types")


def test_simulate_warns_and_succeeds(tmp_path):
    driven_wall.write_rig(tmp_path)
    code = driven_wall.CODE.replace(SMOOTH, KINKED)
    assert code != driven_wall.CODE
    (tmp_path / "shaker.py").write_text(code)
    words = f"simulate --system {tmp_path}/shaker.py:Shaker --state 0,0 --t1 0.05"
    found = CliRunner().invoke(app, words.split())
    assert found.exit_code == 0, found.output
    assert found.stderr.count("`maximum` in `vector_field` has a corner") == 1
    assert "labels, orbits and fits can be wrong" in found.stderr


def test_the_recordings_of_a_kinked_rig_are_read_with_a_warning(tmp_path, capsys):
    file = driven_wall.write_rig(tmp_path)
    warn_of_corners(read_setup(file).model.system)
    assert capsys.readouterr().err == ""
    (tmp_path / "shaker.py").write_text(driven_wall.CODE.replace(SMOOTH, KINKED))
    warn_of_corners(read_setup(file).model.system)
    assert "shaker.py:" in capsys.readouterr().err


def test_no_other_system_causes_a_warning(tmp_path, capsys):
    for name in SYSTEMS:
        make_model(name, None, None, Source(), None)
    (tmp_path / "soft.py").write_text(SWITCHED)
    warn_of_corners(system_class(f"{tmp_path}/soft.py:Soft")())
    assert capsys.readouterr().err == ""


def test_functions_that_fail_are_left_to_the_command(tmp_path, capsys):
    code = driven_wall.CODE.replace(SMOOTH, "float(state[0])")
    (tmp_path / "bad.py").write_text(code)
    warn_of_corners(system_class(f"{tmp_path}/bad.py:Shaker")())
    assert capsys.readouterr().err == ""
