"""The opt-in compiler options: same results, and a word when they come too late."""

import os
import subprocess
import sys

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.hybrid import stroboscope, tune_compiler
from jaxcam.models import ImpactOscillator


_TUNED = """
import sys
import numpy as np
import jaxcam
jaxcam.hybrid.tune_compiler()
from jaxcam.hybrid import stroboscope
from jaxcam.models import ImpactOscillator
starts = np.stack([np.linspace(-0.9, -0.1, 8), np.zeros(8)], axis=1)
made = stroboscope(ImpactOscillator(), starts, 3)
np.savez(sys.argv[1], states=made.states, code=made.code)
"""


def test_tuned_results_are_the_same(tmp_path):
    file = tmp_path / "tuned.npz"
    # without the flags of this process, so that only the call sets them
    environment = {k: v for k, v in os.environ.items() if k != "XLA_FLAGS"}
    subprocess.run(
        [sys.executable, "-c", _TUNED, str(file)], check=True, env=environment
    )
    tuned = np.load(file)
    starts = np.stack([np.linspace(-0.9, -0.1, 8), np.zeros(8)], axis=1)
    plain = stroboscope(ImpactOscillator(), starts, 3)
    assert np.all(tuned["code"] == 0) and np.all(plain.code == 0)
    # three periods magnify the differences of rounding by a few hundred
    assert np.max(np.abs(tuned["states"] - plain.states)) < 1e-10


def test_too_late_is_said():
    jnp.zeros(1)
    with pytest.raises(RuntimeError, match="right after the imports"):
        tune_compiler()
