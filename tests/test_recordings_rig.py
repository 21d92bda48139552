"""The rig file: typed, checked, and turned into a model."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.data import DEMO_RIG
from jaxcam.models import CamFollower
from jaxcam.recordings import read_rig, RigError


@pytest.fixture
def rig():
    return read_rig(DEMO_RIG / "rig.toml")


def refusal(tmp_path, old, new):
    file = tmp_path / "rig.toml"
    before = (DEMO_RIG / "rig.toml").read_text()
    assert old in before
    file.write_text(before.replace(old, new))
    with pytest.raises(RigError) as caught:
        read_rig(file)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_nominal_values(rig):
    assert rig.cam_radius.value == 0.045 and rig.cam_radius.tolerance == 0.001
    assert rig.cam_center_x.value == 0.249 and rig.cam_center_y.tolerance == 0.0004
    assert rig.sensors.gyro is None
    step = 2 * np.pi / 36000
    floor = np.sqrt(7e-5**2 + step**2 / 12)
    assert rig.sensors.follower_floor == pytest.approx(floor)


def test_the_nominal_rig_is_table_4_4(rig):
    state = jnp.array([0.3, 0.5])
    system, table = rig.system(speed=15.0), CamFollower()
    np.testing.assert_allclose(
        system.vector_field(0.0, state), table.vector_field(0.0, state), rtol=1e-14
    )
    assert system.gap(0.1, state) == rig.system(15.0, phase=1.5).gap(0.0, state)


def test_replace(rig):
    other = rig.replace(spring_stiffness=107.0, restitution=0.6)
    assert other.spring_stiffness.value == 107.0
    assert other.spring_stiffness.tolerance == 5.0
    assert other.system(10.0).restitution(10.0, 1.0) == 0.6
    with pytest.raises(RigError, match="is `spring_stiffness` meant"):
        rig.replace(spring_stifness=107.0)


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("cam_radius", "cam_radus", "has no `cam_radius`; rename `cam_radus`"),
        ("[impact]", "[impacts]", "unknown key `impacts`; is `impact` meant?"),
        ("value = 0.045", "value = '0.045'", "must be a number"),
        ("value = 0.045", "vale = 0.045", "`cam_radius` in [geometry] has no `value`"),
        ("tolerance = 0.001, unit", "unit", None),
        ("tolerance = 0.001", "tolerance = -0.001", "negative tolerance"),
        ('unit = "N/m"', 'unit = "N/mm"', 'is given in "N/mm"'),
        ("[0.249, 0.0]", "0.249", "needs two numbers"),
        ('"clockwise"', '"left"', '"clockwise" or "counterclockwise"'),
        ("cam_noise = {value = 9e-5", "cam_noise = {value = 0", "must be positive"),
        ("value = 0.55", "value = 1.55", "between 0 and 1"),
        ("[sensors]", "[sensors]\nseed = 3", "unknown key `seed`"),
        ("[geometry]", "[geometry", "not a TOML file"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, old, new, sentence):
    if sentence is None:
        file = tmp_path / "rig.toml"
        file.write_text((DEMO_RIG / "rig.toml").read_text().replace(old, new))
        assert read_rig(file).cam_radius.tolerance == 0.0
        return
    assert sentence in refusal(tmp_path, old, new)


def test_missing_file(tmp_path):
    with pytest.raises(RigError, match="no such file"):
        read_rig(tmp_path / "rig.toml")
