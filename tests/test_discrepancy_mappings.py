"""Many diagnoses in one process do not run out of memory mappings."""

import jax
import jax.numpy as jnp
import pytest

from jaxcam.discrepancy._mappings import make_room


@pytest.fixture
def process(tmp_path):
    """Files as Linux has them: a number of mappings, and the limit."""

    def made(used: int, limit: int):
        maps, most = tmp_path / "maps", tmp_path / "max_map_count"
        maps.write_text("7f00-7f01 r-xp\n" * used)
        most.write_text(f"{limit}\n")
        return maps, most

    return made


def test_programs_are_dropped_where_there_is_no_room_for_more(process):
    traced = []

    @jax.jit
    def program(x):
        traced.append(1)
        return x + 1

    program(jnp.zeros(3))
    assert not make_room(*process(20_000, 65_530))
    program(jnp.zeros(3))
    assert len(traced) == 1
    assert make_room(*process(40_000, 65_530))
    program(jnp.zeros(3))
    assert len(traced) == 2


def test_where_there_is_no_such_limit_nothing_is_done(tmp_path):
    assert not make_room(tmp_path / "none", tmp_path / "neither")
