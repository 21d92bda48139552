"""Measure the gain of each pass of `jaxcam.hybrid.lowering`.

    python -m benchmarks.lowering

The rig runs at 145 rpm, with a tolerance of 1e-9, on one pinned core. Each pass is
switched off alone, in a separate process. The columns are the CPU seconds of the first
call, and the CPU microseconds per turn of one trajectory (`flow`) and of a batch
(`stroboscope`), each the minimum of several runs; then the same relative to the row
with all passes.
"""

import json
import subprocess
import sys
import time

from benchmarks import _timing


_TURNS, _LANES, _REPEATS = 50, 64, 5


def _without(name: str) -> None:
    """Switch one pass off, before anything is compiled."""
    import jax.numpy as jnp

    from jaxcam.hybrid import _flow
    from jaxcam.hybrid.batch import _layout
    from jaxcam.hybrid.loop import _run
    from jaxcam.hybrid.lowering import _scalarise, with_kept

    if name == "sine in arithmetic":
        setattr(_scalarise, "sincos", lambda x: (jnp.sin(x), jnp.cos(x)))
    elif name == "shared values kept":
        for module in (_flow, _run):
            setattr(
                module,
                "with_kept",
                lambda body, carry, on: with_kept(body, carry, False),
            )
    elif name == "one kernel":
        for module in (_flow, _run, _layout):
            setattr(module, "one_kernel", lambda loop, **_: loop)
    elif name == "library calls outside":
        setattr(_layout, "without_library", lambda function, argument: function)


_PASSES = [
    "nothing",
    "sine in arithmetic",
    "shared values kept",
    "one kernel",
    "library calls outside",
    "all of them",
]


def _measure(name: str) -> dict[str, float]:
    import equinox as eqx
    import jax
    import jax.numpy as jnp
    import numpy as np

    from jaxcam.hybrid import flow, Settings, simulate, stroboscope
    from jaxcam.models import CamFollower, rpm_to_rad_s

    _without(name)
    plain = name == "all of them"
    settings = Settings(tolerance=1e-9, chatter_depth=1.0, plain=plain)
    rig = eqx.tree_at(lambda s: s.speed, CamFollower(), jnp.asarray(rpm_to_rad_s(145)))
    turn = float(rig.period)
    state = simulate(rig, None, 0.0, 3 * turn).final

    @jax.jit
    def one(state):
        made = flow(rig, state, 0.0, _TURNS * turn, settings=settings, max_steps=65536)
        return made.state

    states = np.tile(np.asarray(state), (_LANES, 1))
    calls = {
        "one": lambda: jax.block_until_ready(one(state)),
        "many": lambda: stroboscope(rig, states, _TURNS, settings=settings).states,
    }
    found = {}
    for key, call in calls.items():
        begin = time.process_time()
        call()
        found[f"first {key}"] = time.process_time() - begin
    rows = _timing.compare(calls, {"one": _TURNS, "many": _TURNS * _LANES}, _REPEATS)
    return found | {row.name: 1e6 / row.rate for row in rows}


def main() -> None:
    if len(sys.argv) > 1:
        _timing.pin()
        print(json.dumps(_measure(sys.argv[1])))
        return
    print(f"{'without':24}{'first call (s)':>18}{'a turn (us)':>18}{'over all':>24}")
    whole: dict[str, float] = {}
    for name in _PASSES:
        line = [sys.executable, "-m", "benchmarks.lowering", name]
        made = subprocess.run(line, check=True, capture_output=True, text=True)
        found = json.loads(made.stdout.splitlines()[-1])
        whole = whole or found
        numbers = [found[k] for k in ("first one", "first many", "one", "many")]
        ratios = [found[k] / whole[k] for k in found]
        print(
            f"{name:24}"
            + "".join(f"{n:9.1f}" for n in numbers)
            + "".join(f"{r:8.2f}" for r in ratios),
            flush=True,
        )


if __name__ == "__main__":
    main()
