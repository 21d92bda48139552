"""Recordings of a rig simulator that shares no code with this project."""

import json
from pathlib import Path

import pytest

from jaxcam.discrepancy import diagnose
from jaxcam.recordings import read_case, read_rig


SHARED = Path(__file__).parents[2] / "shared" / "recordings"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (SHARED / "practice").is_dir(),
        reason="the recordings are not beside the project (../shared/recordings)",
    ),
]


def _keys():
    file = SHARED / "practice" / "keys.json"
    return json.loads(file.read_text()) if file.is_file() else []


@pytest.mark.parametrize("key", _keys(), ids=lambda key: key["case"])
def test_a_practice_case_is_answered_rightly(key):
    found = diagnose(
        read_rig(SHARED / "rig.toml"),
        tuple(read_case(SHARED / "practice" / key["case"])),
        case=key["case"],
    )
    truth = {effect["effect"]: effect["parameters"] for effect in key["effects"]}
    if "hidden_mode" in truth:
        assert found.verdict == "unknown"
        return
    assert found.verdict == ("effect" if truth else "none")
    assert set(found.names) == set(truth)
    for effect in found.effects:
        for name, value in truth[effect.name].items():
            one = effect.parameters[name]
            off = abs(one.value - value)
            assert off < max(0.15 * abs(value), 2 * one.stderr)
    assert found.heldout_after < 1.3 * found.noise_floor
