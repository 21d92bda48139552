"""Compiled code is kept on disk, and made again where it is not as it was."""

import ctypes

import jax
import numpy as np
import pytest

from jaxcam.hybrid.backend import _machine, Mapped


_TEXT = """
define double @twice(double %x) {
  %y = fadd double %x, %x
  ret double %y
}
"""


@pytest.fixture
def folder(tmp_path):
    before = jax.config.jax_compilation_cache_dir  # pyright: ignore
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path / "llvm"
    jax.config.update("jax_compilation_cache_dir", before)


def _twice(x):
    function = _machine.compiled(_TEXT, "twice", ctypes.c_double, [ctypes.c_double])
    return function(x)


def test_code_is_kept(folder, monkeypatch):
    assert _twice(2.0) == 4.0
    (file,) = folder.iterdir()
    monkeypatch.setattr(_machine, "_code_of", None)
    assert _twice(3.0) == 6.0
    assert [*folder.iterdir()] == [file]


def test_code_that_was_cut_off_is_made_again(folder):
    assert _twice(2.0) == 4.0
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    for wrong in (whole[:-10], b"", whole[:40] + b"?" + whole[41:]):
        file.write_bytes(wrong)
        assert _twice(2.5) == 5.0
        assert file.read_bytes() == whole


def test_another_machine_or_version_has_code_of_its_own(monkeypatch):
    key = _machine._key(_TEXT)
    assert _machine._key(_TEXT + " ") != key
    monkeypatch.setattr(_machine, "_features", lambda: "+none")
    assert _machine._key(_TEXT) != key


def test_without_a_place_it_is_compiled_anew(monkeypatch):
    monkeypatch.setattr(_machine, "_folder", lambda: None)
    assert _twice(4.0) == 8.0


def test_the_same_code_at_every_width():
    """Results do not depend on how many numbers a vector holds."""

    def function(shared, own):
        return [own[0] * shared[0] + own[1], own[0] / (1.0 + own[1] * own[1])]

    own = np.random.default_rng(0).normal(size=(29, 2))
    made = [Mapped(function, 1, 2, width)(np.array([1.5]), own) for width in (1, 2, 4)]
    for other in made[1:]:
        np.testing.assert_array_equal(made[0], other)
