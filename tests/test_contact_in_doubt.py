"""A column in another unit than stated contradicts the positions of the stops."""

import driven_wall
import pytest

from jaxcam.fitting import read_setup


@pytest.fixture(scope="module")
def setup(tmp_path_factory):
    return read_setup(driven_wall.write_rig(tmp_path_factory.mktemp("rig")))


@pytest.mark.parametrize(
    ("column", "scale", "said"),
    [
        ("position_m", 1.0, []),
        ("position_mm", 1e3, []),
        # metres that are declared as millimetres, and the reverse
        ("position_mm", 1.0, ["No impact was found", "wall is at 0.015 m", "m or mm?"]),
        ("position_m", 1e3, ["beyond the stop", "wall is at 0.015 m", "m or mm?"]),
        # far from the wall, as in a recording of free vibrations
        ("position_m", 0.2, ["No impact was found", "If the rig does hit a stop"]),
    ],
)
def test_positions_are_compared_with_the_stops(setup, tmp_path, column, scale, said):
    case = driven_wall.write_case(tmp_path / "case", column=column, scale=scale)
    found = setup.contact_in_doubt(setup.segments(setup.read_case(case)))
    assert bool(found) == bool(said)
    assert all(part in found for part in said), found


@pytest.mark.parametrize("known", (True, False))
def test_the_tolerance_of_an_offset_allows_positions_beyond_a_stop(tmp_path, known):
    """An offset of 12 mm is a contradiction only if no offset is allowed for."""
    rig = driven_wall.RIG
    if not known:
        allowed = "offset = {value = 0.0, tolerance = 0.02}\nnoise ="
        assert rig.count("noise =") == 1
        rig = rig.replace("noise =", allowed)
    folder = tmp_path / "rig"
    folder.mkdir()
    setup = read_setup(driven_wall.write_rig(folder, rig))
    case = driven_wall.write_case(tmp_path / "case", offset=12e-3)
    found = setup.contact_in_doubt(setup.segments(setup.read_case(case)))
    assert ("beyond the stop" in found) == known
