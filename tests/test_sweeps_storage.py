"""Sweeps that are stopped, damaged, or run elsewhere: the result is the same."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import textwrap
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
import zarr
from sweep_maps import LOGISTIC, SQUARE_ROOT

from jaxcam.fitting.own_systems import system_class
from jaxcam.models import ImpactOscillator
from jaxcam.sweeps import basins, diagram, Grid, load_sweep, Map, Stroboscopic
from jaxcam.sweeps._inputs import as_section
from jaxcam.sweeps.blocks import about_section
from jaxcam.sweeps.blocks._disk import OnDisk


GRID = Grid((-2, -2), (2, 2), (24, 10))
#: eight blocks of three rows
OPTIONS = {"turns": 40, "block": 3}


@pytest.fixture(scope="module")
def whole():
    return basins(SQUARE_ROOT, GRID, **OPTIONS)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored") / "sweep"
    basins(SQUARE_ROOT, GRID, out=folder, **OPTIONS)
    return folder


@pytest.fixture
def copy(stored, tmp_path):
    return Path(shutil.copytree(stored, tmp_path / "copy"))


def again(folder):
    return basins(SQUARE_ROOT, GRID, out=folder, resume=True, **OPTIONS)


def same(one, other) -> bool:
    """Equal to the last bit, whatever is only on disk aside."""
    names = set(one.dataset.variables) & set(other.dataset.variables)
    assert {"attractor", "fingerprint", "orbit"} <= names
    return one.dataset[sorted(names)].load().equals(other.dataset[sorted(names)].load())


def test_on_disk_as_in_memory(whole, stored):
    assert same(whole, load_sweep(stored))


def test_read_without_jaxcam(stored, whole):
    """xarray alone finds names, units, attractors and the system of the sweep."""
    script = f"""
        import json, sys, warnings
        import xarray
        warnings.simplefilter("error")
        data = xarray.open_dataset({str(stored)!r}, engine="zarr", consolidated=False)
        assert data["attractor"].dims == ("x1", "x2"), data["attractor"].dims
        assert [str(n) for n in data["name"].values] == ["period 1 a", "period 1 b"]
        assert json.loads(data.attrs["sweep"])["turns"] == 40
        print(int((data["attractor"] == 0).sum()), "jaxcam" in sys.modules)
    """
    found = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stderr
    assert found.stdout.split() == [str((whole.attractor == 0).sum()), "False"]


def test_a_finished_sweep_is_not_computed_again(copy, whole, monkeypatch):
    def never(*_):
        raise AssertionError("a finished block was written again")

    monkeypatch.setattr(OnDisk, "write", never)
    assert same(again(copy), whole)


def _cells(folder, name, block):
    files = [f for f in (folder / name / "c" / str(block)).rglob("*") if f.is_file()]
    assert files
    return files[0]


@pytest.mark.parametrize("name", ["turns", "fingerprint", "impacts"])
def test_a_damaged_chunk_is_named_and_computed_again(copy, whole, name):
    file = _cells(copy, name, 2)
    content = bytearray(file.read_bytes())
    content[-3] ^= 0x55
    file.write_bytes(bytes(content))
    with pytest.raises(ValueError, match="block 2 (is damaged|cannot be read).*resume"):
        load_sweep(copy)
    assert same(again(copy), whole) and same(load_sweep(copy), whole)


def test_a_missing_chunk_is_named_and_computed_again(copy, whole):
    _cells(copy, "fingerprint", 5).unlink()
    _cells(copy, "fingerprint", 6).write_bytes(b"")
    with pytest.raises(ValueError, match="block 5 .*2 of 8 blocks are wrong: 5, 6"):
        load_sweep(copy)
    assert same(again(copy), whole)


@pytest.mark.parametrize("how", ["lost", "damaged", "never written"])
def test_attractors_that_are_damaged_are_named_and_found_again(copy, whole, how):
    if how == "lost":
        _cells(copy, "attractor", 0).unlink()
    elif how == "damaged":
        file = _cells(copy, "attractor", 0)
        file.write_bytes(file.read_bytes()[:-1])
    else:
        group = zarr.open_group(str(copy), mode="r+")
        del group.attrs["together"]
    with pytest.raises(ValueError, match="resume=True to .*attractor"):
        load_sweep(copy)
    assert same(again(copy), whole) and same(load_sweep(copy), whole)


def test_the_disk_is_full(tmp_path, whole, monkeypatch):
    """The error comes out, and what was stored before it is kept."""
    write, count = OnDisk.write, []

    def full(self, block, arrays):
        count.append(block)
        if len(count) == 4:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.path))
        write(self, block, arrays)

    folder = tmp_path / "sweep"
    with monkeypatch.context() as patch:
        patch.setattr(OnDisk, "write", full)
        with pytest.raises(OSError, match="No space left"):
            basins(SQUARE_ROOT, GRID, out=folder, workers=1, **OPTIONS)
    finished = zarr.open_group(str(folder), mode="r")["checksum"][:]
    assert np.count_nonzero(finished >= 0) == 3
    assert same(again(folder), whole)


_CHILD = """
    import sys, time
    sys.path.insert(0, {tests!r})
    from sweep_maps import SQUARE_ROOT
    from jaxcam.sweeps import basins, Grid

    def slowly(at):
        print(at.done, flush=True)
        time.sleep(0.3)

    grid = Grid((-2, -2), (2, 2), (24, 10))
    basins(SQUARE_ROOT, grid, 40, block=3, out={folder!r}, workers=1, progress=slowly)
"""


def test_killed_in_the_middle(tmp_path, whole):
    """SIGKILL after three of eight blocks; the rest is computed on resuming."""
    folder = tmp_path / "sweep"
    script = _CHILD.format(tests=str(Path(__file__).parent), folder=str(folder))
    child = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(script)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert child.stdout is not None
    with child:
        for line in child.stdout:
            if line.strip() == "3":
                child.send_signal(signal.SIGKILL)
                break
    assert child.returncode == -signal.SIGKILL
    with pytest.raises(ValueError, match="is not finished"):
        load_sweep(folder)
    seen = []
    found = basins(
        SQUARE_ROOT, GRID, out=folder, resume=True, progress=seen.append, **OPTIONS
    )
    assert seen[0].done >= 4 and seen[-1].done == seen[-1].total == 8
    assert seen[-1].remaining == 0.0 <= seen[0].remaining
    assert same(found, whole)


def test_another_sweep_is_not_mixed_in(stored):
    with pytest.raises(ValueError, match="already contains a sweep; pass resume=True"):
        basins(SQUARE_ROOT, GRID, out=stored, **OPTIONS)
    with pytest.raises(ValueError, match=r"different sweep \(other turns\)"):
        basins(SQUARE_ROOT, GRID, 41, block=3, out=stored, resume=True)
    with pytest.raises(ValueError, match=r"different sweep \(other sweep, "):
        diagram(LOGISTIC, "mu", [3.0], [0.3], out=stored, resume=True)


def _line(slope, offset):
    return lambda x, p: slope * x + p["a"] + offset


@pytest.mark.parametrize(
    "edited",
    [
        lambda x, p: 0.5 * x + 2.0 * p["a"],
        lambda x, p: 0.5 * x - p["a"],
        lambda x, p: jnp.sin(x) + p["a"],
        _line(0.5, 1.0),
    ],
    ids=["constant", "operation", "name", "closure"],
)
def test_an_edited_function_is_another_sweep(tmp_path, edited):
    """The name of every lambda is the same; its code is not."""

    def run(function, resume):
        function.__qualname__ = "<lambda>"
        section = Map(function, {"a": 1.0})
        return diagram(
            section, "a", [1.0], [0.3], turns=8, keep=2, out=tmp_path, resume=resume
        )

    base = _line(0.5, 0.0) if edited.__closure__ else lambda x, p: 0.5 * x + p["a"]
    run(base, False)
    with pytest.raises(ValueError, match="different sweep"):
        run(edited, True)
    run(_line(0.5, 0.0) if edited.__closure__ else base, True)


def test_the_identity_of_a_function_is_equal_in_another_process():
    """A set of constants is the usual cause of a difference: its order is random."""
    script = """
        from jaxcam.sweeps.blocks._identity import about_section
        from jaxcam.sweeps import Map
        def f(x, p):
            return [y for y in x if y in {"a", "b", "c", "d"}]
        print(about_section(Map(f))["function"]["sha256"])
    """
    found = [
        subprocess.run(
            [sys.executable, "-c", textwrap.dedent(script)],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    ]
    assert found[0] == found[1] and len(found[0].strip()) == 64


def test_a_folder_with_something_else_is_left_alone(tmp_path):
    (tmp_path / "letter.txt").write_text("dear reader")
    with pytest.raises(ValueError, match="contains something else"):
        basins(SQUARE_ROOT, GRID, out=tmp_path, **OPTIONS)
    assert (tmp_path / "letter.txt").read_text() == "dear reader"


@pytest.mark.parametrize("workers", [1, 3])
def test_threads_change_nothing(whole, workers):
    assert same(basins(SQUARE_ROOT, GRID, workers=workers, **OPTIONS), whole)
    with ThreadPoolExecutor(workers) as pool:
        assert same(basins(SQUARE_ROOT, GRID, executor=pool, **OPTIONS), whole)


def test_blocks_change_no_result(whole):
    found = basins(SQUARE_ROOT, GRID, 40, block=7)
    assert np.array_equal(found.attractor, whole.attractor)
    assert np.array_equal(found.orbits, whole.orbits, equal_nan=True)


@pytest.mark.slow
def test_processes_change_nothing(whole):
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        assert same(basins(SQUARE_ROOT, GRID, executor=pool, **OPTIONS), whole)


def test_a_chain_of_values_is_resumed_where_it_stopped(tmp_path):
    """The state that was carried into a block is read from the one before it."""
    options = {"turns": 200, "keep": 16, "direction": "both", "block": 4}
    values = np.linspace(2.8, 3.6, 21)
    where = lambda p: p["mu"]
    whole = diagram(LOGISTIC, where, values, [[0.3], [0.6]], **options)
    folder = tmp_path / "sweep"
    diagram(LOGISTIC, where, values, [[0.3], [0.6]], out=folder, **options)
    _cells(folder, "final", 4).unlink()
    found = diagram(
        LOGISTIC, where, values, [[0.3], [0.6]], out=folder, resume=True, **options
    )
    assert np.array_equal(found.states, whole.states)
    assert found.direction.tolist() == [1] * 21 + [-1] * 21
    assert np.array_equal(found.values[:21], values)
    assert np.array_equal(found.values[21:], values[::-1])


SYSTEM = """
import jax.numpy as jnp
from jaxcam import HybridSystem

FACTOR = 1.0


class Damper:
    SIZE = 0.1

    @staticmethod
    def force(v):
        return Damper.SIZE * v


def spring(x):
    return FACTOR * x


class Driven(HybridSystem):
    state_names = ("position", "velocity")
    SCALE = 1.0
    omega: float = 2.0

    def vector_field(self, t, state):
        push = self.SCALE * jnp.cos(self.omega * t) - Damper.force(state[1])
        return jnp.stack([state[1], push - spring(state[0]) - 0.1 * state[1]])

    def gap(self, t, state):
        return 9.0 - state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -0.5 * state[1]])

    @property
    def period(self):
        return 2 * jnp.pi / self.omega
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("0.1 * state[1]", "0.2 * state[1]"),
        ("FACTOR = 1.0", "FACTOR = 1.5"),
        ("FACTOR * x", "FACTOR * jnp.sin(x)"),
        ("2 * jnp.pi", "4 * jnp.pi"),
        ("SCALE = 1.0", "SCALE = 2.0"),
        ("SIZE = 0.1", "SIZE = 0.2"),
    ],
)
def test_an_edited_system_is_another_sweep(tmp_path, old, new):
    """Its class and numbers are the same; its code, or what that uses, is not."""

    def about(code):
        (tmp_path / "driven.py").write_text(code)
        system = system_class(f"{tmp_path}/driven.py:Driven")()
        return about_section(as_section(system))

    first = about(SYSTEM)
    assert about(SYSTEM + "# a comment") == first
    assert old in SYSTEM and about(SYSTEM.replace(old, new)) != first


def test_what_to_do_with_the_sweep_of_an_edited_system(tmp_path):
    def run(resume=False, **options):
        section = Stroboscopic(ImpactOscillator(**options), lanes=1)
        return diagram(
            section, "omega", [2.6], [0.0, 0.0], turns=2, keep=1, out=tmp_path / "d",
            resume=resume,
        )  # fmt: skip

    run(wall=0.1)
    for resume in (False, True):
        with pytest.raises(ValueError, match="delete it if you edited the system"):
            run(resume, wall=0.2)
    with pytest.raises(ValueError, match="resume=True to continue it"):
        run(wall=0.1)


def test_shipped_systems_are_known_by_their_version():
    assert "code of the system" not in about_section(as_section(ImpactOscillator()))
