"""Every public entry under every transformation of JAX, each in a process of its own.

XLA can end a process where it should report an error: in a process of its own that is
the failure of one test. Values are checked against each other: the compiled against
the untraced run within 1e-9, jvp against central differences within 2e-5,
linearisation, Jacobians and gradients against jvp within 1e-11 (1e-10 for a sum),
Hessians against central differences of the jvp within 1e-4, all relative to the
largest number; fits find a parameter again within 1e-6.
"""

import os
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import pytest
from transformed import ALL
from transformed_cases import Ball, GROUPS, MOTIONS

import jaxcam
import variational
from jaxcam.hybrid import stroboscope
from jaxcam.models import CamFollower, simulate_through_joints


_HERE = Path(__file__).parent
_QUICK = [
    ("simulate:faq-ball", ("jit", "vmap", "jvp", "linearize", "grad")),
    pytest.param(
        "simulate:faq-ball",
        ("jacfwd", "hessian", "least_squares"),
        marks=pytest.mark.slow,
    ),
    ("simulate:readme-pendulum", ("linearize", "grad")),
    # runs of constants in a loop of optimistix
    pytest.param("simulate:cam", ("least_squares",), marks=pytest.mark.slow),
]


def _run(group: str, *names: str) -> None:
    environment = os.environ | {
        "JAX_COMPILATION_CACHE_DIR": jax.config.jax_compilation_cache_dir or "",
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        "PYTHONPATH": os.pathsep.join([str(_HERE.parent), *sys.path]),
    }
    done = subprocess.run(
        [sys.executable, "-W", "error", str(_HERE / "transformed.py"), group, *names],
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, (done.returncode, done.stdout, done.stderr[-3000:])
    assert done.stdout.split() == list(names)


@pytest.mark.parametrize(("group", "names"), _QUICK)
def test_a_few(group, names):
    _run(group, *names)


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_all(group):
    _run(group, *ALL)


def _refused(function, *arguments) -> str:
    with pytest.raises(ValueError) as error:
        jax.jit(function)(*arguments)
    return str(error.value)


@pytest.mark.parametrize(
    ("name", "function"),
    [
        ("stroboscope", lambda x: stroboscope(CamFollower(), x, 3)),
        ("orbit_of", lambda x: variational.orbit_of(CamFollower(), x)),
        ("lyapunov_spectrum", lambda x: variational.lyapunov_spectrum(Ball(), x, 9)),
        (
            "simulate_through_joints",
            lambda x: simulate_through_joints(CamFollower(), x, 0.0, 1.0),
        ),
        (
            'engine="diffeqsolve"',
            lambda x: jaxcam.simulate(Ball(), x, 0.0, 1.0, engine="diffeqsolve"),
        ),
    ],
)
def test_what_is_driven_from_python_says_so(name, function):
    """In one sentence that names what to use, under every transformation."""
    state = jnp.array([1.0, 0.0])
    said = _refused(function, state)
    assert name in said and "driven from Python" in said and "use " in said
    for transform in (jax.vmap, jax.jacfwd, jax.jacrev):
        with pytest.raises(ValueError, match="driven from Python"):
            transform(function)(
                jnp.stack([state, state]) if transform is jax.vmap else state
            )


def test_sections_of_a_traced_run_say_so():
    motion = MOTIONS["oscillator"]

    def run(x):
        return jaxcam.simulate(motion.system(0.8), motion.start(x), 0.0, 1.0)

    start = jnp.asarray(-0.4)
    said = _refused(lambda x: run(x).section(lambda t, y: y[0]), start)
    assert "section is driven from Python" in said and "trajectory.at" in said
    said = _refused(lambda x: run(x).stroboscopic(), start)
    assert "stroboscopic is driven from Python" in said
