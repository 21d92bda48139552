"""The parameter that a command varies: its name and its unit."""

import pytest

from jaxcam.cli._axis import Axis
from jaxcam.cli._choices import CAM
from jaxcam.cli._parameters import assign_parameters, chosen_parameter, full_name
from jaxcam.discrepancy.terms import system_with_terms
from jaxcam.models import BouncingBall, CamFollower, ImpactOscillator
from jaxcam.parameters import pick


# what a user sees, whose types nothing checks
pytestmark = pytest.mark.usefixtures("unchecked_types")


def test_the_name_of_a_parameter_need_not_name_the_part_that_it_belongs_to():
    """As in a diagnosed model, whose base is the system of the rig."""
    system = system_with_terms(ImpactOscillator(2.6, 0.8, 0.0), ())
    assert chosen_parameter(system, "omega") == "base.omega"
    assert chosen_parameter(system, "base.omega") == "base.omega"
    assert float(pick("omega", system)(system)) == 2.6
    changed = assign_parameters(system, ["wall=0.1"])
    assert float(changed.base.wall) == 0.1  # pyright: ignore
    assert chosen_parameter(CamFollower(), "speed") == "speed"


def test_a_name_that_is_not_unique_is_not_guessed():
    assert full_name("r", ["a.r", "b.r"]) == "r"
    assert full_name("r", ["r", "b.r"]) == "r"
    with pytest.raises(ValueError, match="--parameter frequancy does not exist"):
        chosen_parameter(BouncingBall(), "frequancy")


def test_a_missing_name_is_asked_for():
    with pytest.raises(ValueError, match="--parameter NAME; .* gravity, restitution"):
        chosen_parameter(BouncingBall(), "speed")


def test_a_unit_on_the_command_line_takes_precedence():
    units = {"frequency": "Hz"}
    assert Axis.of("frequency", "Rig", units).symbol == "Hz"
    assert Axis.of("frequency", "Rig", units, "1/s").label == ("frequency", "1/s")
    assert Axis.of("speed", CAM, {}, "rpm").symbol == "rpm"
    with pytest.raises(ValueError, match="in rpm"):
        Axis.of("speed", CAM, {}, "rad/s")
