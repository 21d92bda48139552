"""Command lines of any kind: accepted, or refused with one sentence and exit code 2."""

import hostile_commands as hostile
import pytest
from hypothesis import given, HealthCheck, settings


# what a user sees, whose types nothing checks
pytestmark = pytest.mark.usefixtures("unchecked_types")

FEW = settings(max_examples=20, suppress_health_check=list(HealthCheck))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("lines")


@FEW
@given(line=hostile.lines())
def test_any_line(folder, line):
    hostile.run_or_say(folder, line)
