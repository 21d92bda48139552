"""The real recording that ships with the package, with what it owes its makers."""

import numpy as np
import pytest

from jaxcam.data import PENDULUM
from jaxcam.fitting import read_setup


def test_it_comes_with_its_source_and_its_licence():
    source = (PENDULUM / "SOURCE.md").read_text("utf-8")
    assert "github.com/dynamicslab/MultiArm-Pendulum" in source
    assert "2205.06231" in source
    licence = (PENDULUM / "LICENSE").read_text("utf-8")
    assert licence.startswith("MIT License")
    assert "Copyright (c) 2022 dynamicslab" in licence


def test_it_is_small():
    assert sum(file.stat().st_size for file in PENDULUM.glob("*.gz")) < 300_000


def test_both_swings_are_read_with_the_rig_file():
    setup = read_setup(PENDULUM / "rig.toml")
    large, small = setup.read_case(PENDULUM)
    assert (large.name, small.name) == ("swing_large", "swing_small")
    for run, start in ((large, -92.7), (small, -3.8)):
        np.testing.assert_allclose(np.diff(run.time), 0.01, rtol=1e-9)
        below = np.degrees(run["angle_rad"] - np.pi)
        assert below[0] == pytest.approx(start, abs=0.1)
        # it swings about straight down, and ever less
        assert np.abs(np.mean(below)) < 1.0
        half = len(below) // 2
        assert np.ptp(below[half:]) < np.ptp(below[:half])
