"""Hash the programs that jaxcam generates for some systems, without compiling them.

A source change that changes no program has no effect on these systems.
"""

import hashlib
import re
import sys
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp


sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from textbook_systems import BallBetweenWalls, parameters, TwoMasses, TwoStops

import jaxcam
from jaxcam.models import BouncingBall


_CHAIN = dict(omega=0.6, stop=0.1, force=1.0)
_CHAIN |= dict(restitution=0.6, stiffness=1.0, damping=0.1)


def digest() -> str:
    """Hash the programs of forward and reverse runs, with samples between the steps."""
    walls = parameters(gravity=9.81, width=1.0, restitution=0.8)
    cases = (
        (BouncingBall(amplitude=0.02, frequency=31.0), 2),
        (BallBetweenWalls(**walls), 2),
        (TwoMasses(**parameters(**_CHAIN)), 4),
        (TwoStops(**parameters(**_CHAIN)), 4),
    )
    found = hashlib.sha256()
    for system, n in cases:
        system = jax.tree.map(jnp.asarray, system)
        numbers, rest = eqx.partition(system, eqx.is_array)

        def run(numbers, state, t1, way, rest=rest):
            motion = jaxcam.simulate(
                eqx.combine(numbers, rest),
                state,
                0.0,
                t1,
                max_steps=64,
                derivatives=way,
            )
            parts = motion.impacts, motion.contacts, motion.steps, motion.code
            return parts, motion.at(jnp.linspace(0.0, 1.0, 3))

        for way in ("forward", "reverse"):
            made = jax.make_jaxpr(lambda *a, way=way: run(*a, way))(
                numbers, jnp.zeros(n), jnp.asarray(1.0)
            )
            # Python functions are printed with their addresses
            found.update(re.sub("0x[0-9a-f]+", "", str(made.jaxpr)).encode())
            for constant in made.consts:
                found.update(jnp.asarray(constant).tobytes())
    return found.hexdigest()


if __name__ == "__main__":
    print(digest())
