"""Batches on a GPU: the code for it, run thread by thread on the CPU; and its PTX."""

import ctypes
import importlib.util
import pathlib
import re
import types

import numpy as np
import pytest

import jaxcam
from jaxcam.hybrid import Settings, stroboscope
from jaxcam.hybrid.backend import _attempts, _cuda, _kernel, _machine, _ptx
from jaxcam.models import (
    BeltOscillator,
    CamFollower,
    ImpactOscillator,
    ReliefValve,
    SpinningBall,
    TwoSidedStop,
)


_GPU = Settings(tolerance=1e-9, chatter_depth=1.0, backend="cuda")
_CPU = Settings(tolerance=1e-9, chatter_depth=1.0, backend="llvm")
_REGISTER = re.compile(r'@"llvm\.nvvm\.read\.ptx\.sreg\.(\w+)\.x"')


class _Emulated:
    """A GPU with few threads, each of which makes three attempts per launch."""

    threads, patience = 6, 3

    def __init__(self, text: str):
        self.registers = {
            name: ctypes.c_int32() for name in ("ntid", "ctaid", "tid", "nctaid")
        }
        text = _REGISTER.sub(r'@"register.\1"', text.replace("ptx_kernel ", ""))
        text = re.sub(r"^declare i32 .*$", "", text, flags=re.MULTILINE)
        for name, value in self.registers.items():
            place = f"inttoptr (i64 {ctypes.addressof(value)} to ptr)"
            text += f'\ndefine i32 @"register.{name}"() {{\n'
            text += f"  %v = load volatile i32, ptr {place}\n  ret i32 %v\n}}\n"
        arguments = _attempts._ARGUMENTS
        self.function = _machine.compiled(text, _kernel.ENTRY, None, arguments)
        self.kernel = types.SimpleNamespace(ptr=0)

    def __call__(self, blocks, block, arguments):
        (blocks,), (size,) = blocks, block
        numbers = [
            a.ctypes.data if isinstance(a, np.ndarray) else a.item() for a in arguments
        ]
        numbers[-1] = self.patience
        self.registers["ntid"].value = size
        self.registers["nctaid"].value = blocks
        for k in range(blocks * size):
            self.registers["ctaid"].value, self.registers["tid"].value = divmod(k, size)
            self.function(*numbers)


def _emulate(monkeypatch):
    """Let the backend find a GPU that is emulated on the CPU."""

    def module(path):
        text = pathlib.Path(path).read_text()
        return types.SimpleNamespace(get_function=lambda _: _Emulated(text))

    driver = types.SimpleNamespace(
        occupancyMaxActiveBlocksPerMultiprocessor=lambda *_: 1
    )
    device = types.SimpleNamespace(
        compute_capability="80",
        attributes={"MultiProcessorCount": 3},
        use=lambda: None,
        id=0,
    )
    cupy = types.SimpleNamespace(
        asarray=np.array,
        asnumpy=np.asarray,
        zeros=np.zeros,
        full=np.full,
        arange=np.arange,
        RawModule=module,
        cuda=types.SimpleNamespace(driver=driver, Device=lambda: device),
    )
    monkeypatch.setattr(_cuda, "_cupy", lambda: cupy)
    monkeypatch.setattr(_cuda, "ptx_of", lambda text, *_: text)
    monkeypatch.setattr(_cuda, "_libdevice", lambda: None)
    monkeypatch.setattr(_cuda, "_BLOCK", 2)
    _cuda._KNOWN.clear()


_RANDOM = np.random.default_rng(5)
_CASES = {
    "oscillator": (ImpactOscillator(), np.column_stack([np.zeros(20), np.ones(20)])),
    "cam": (CamFollower(), np.array([[0.6, 0.1], [0.55, 0.0], [0.7, -1.0]] * 5)),
    "two stops": (TwoSidedStop(), _RANDOM.uniform(-0.01, 0.01, (11, 2))),
    "belt": (BeltOscillator(), _RANDOM.uniform(-1, 1, (7, 2))),
}


@pytest.mark.parametrize("name", _CASES)
def test_threads_that_share_a_queue(monkeypatch, name):
    """Samples, impacts and attempts of six threads: those of the vector loop, to
    1e-9.
    """
    _emulate(monkeypatch)
    system, states = _CASES[name]
    if isinstance(system, ImpactOscillator):
        values = np.linspace(2.4, 2.9, len(states))
        sweep = dict(where=lambda s: s.omega, values=values)
    else:
        sweep = {}
    period = None if system.period is not None else 2.0
    ours, theirs = (
        stroboscope(system, states, 5, settings=s, period=period, **sweep)
        for s in (_GPU, _CPU)
    )
    assert np.all(ours.code == 0)
    assert np.abs(ours.states - theirs.states).max() < 1e-9
    assert np.array_equal(ours.impacts, theirs.impacts)
    assert np.abs(ours.steps - theirs.steps).max() <= 2


def test_a_limit_of_attempts(monkeypatch):
    _emulate(monkeypatch)
    made = stroboscope(
        ImpactOscillator(), [[0.0, 1.0]] * 9, 50, settings=_GPU, max_steps=20
    )
    assert np.all(made.steps == 20) and np.all(made.code == 1)


@pytest.mark.parametrize(
    "system, start",
    [
        (ImpactOscillator(), [0.0, 1.0]),
        (ReliefValve(), np.ones(3)),
        (SpinningBall(), np.ones(5)),
    ],
)
def test_ptx(monkeypatch, system, start):
    """The code compiles to PTX: one kernel, without functions of other libraries."""
    texts = []
    _emulate(monkeypatch)
    monkeypatch.setattr(_cuda, "ptx_of", lambda text, *_: texts.append(text) or text)
    stroboscope(system, [start], 1, settings=_GPU, period=0.01)
    code = _ptx.ptx_of(texts[0], "sm_80")
    assert code.count(".visible .entry run(") == 1 and ".target sm_80" in code
    outside = re.findall(r"\.extern \.func.*?(\w+)\s*\n?\(", code, re.DOTALL)
    assert all(name.startswith("__nv_") for name in outside)


def test_functions_of_the_c_library_are_those_of_libdevice():
    text = """
declare double @"tan"(double %".1")
define ptx_kernel void @"run"(ptr %p) {
  %x = load double, ptr %p
  %y = call double @"tan"(double %x)
  store double %y, ptr %p
  ret void
}
"""
    assert _ptx.needed(text) == ["tan"]
    code = _ptx.ptx_of(text, "sm_80")
    assert "__nv_tan" in code and re.search(r"\.extern \.func", code)


def test_without_cupy():
    if importlib.util.find_spec("cupy") is not None:
        pytest.skip("CuPy is installed")
    with pytest.raises(ValueError, match=r"pip install \"jaxcam\[cuda\]\""):
        stroboscope(ImpactOscillator(), [0.0, 1.0], 2, settings=_GPU)


def test_one_trajectory_runs_on_the_cpu():
    """With `backend="cuda"`, `simulate` runs with LLVM on the CPU."""
    one, other = (
        jaxcam.simulate(ImpactOscillator(), [0.0, 1.0], 0.0, 9.0, settings=s)
        for s in (_GPU, _CPU)
    )
    assert np.array_equal(one.final, other.final)


def test_on_a_gpu():
    """The same comparison on a real one."""
    cupy = pytest.importorskip("cupy", reason="CuPy is not installed")
    if not cupy.cuda.is_available():
        pytest.skip("there is no NVIDIA GPU")
    states = np.column_stack([np.zeros(500), np.linspace(0.5, 1.5, 500)])
    ours, theirs = (
        stroboscope(ImpactOscillator(), states, 5, settings=s) for s in (_GPU, _CPU)
    )
    assert np.abs(ours.states - theirs.states).max() < 1e-9
    assert np.array_equal(ours.impacts, theirs.impacts)


def test_plain_programs_do_not_run_on_a_gpu():
    with pytest.raises(ValueError, match="plain=True runs with XLA"):
        Settings(plain=True, backend="cuda").check()
