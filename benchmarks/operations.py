"""Count the scalar operations of an attempted step, by purpose.

    python -m benchmarks.operations

Operations are counted in the program of one attempt for the cam-follower, before the
compiler fuses them. A division or square root costs as much as several additions. The
number of attempts per turn is printed last.
"""

import collections

import jax
import jax.numpy as jnp
import numpy as np
from jax.interpreters import partial_eval

import jaxcam  # noqa: F401  64-bit floats
from jaxcam.hybrid import Settings, stroboscope
from jaxcam.hybrid.loop._advance import Plan
from jaxcam.hybrid.loop._functions import Functions
from jaxcam.hybrid.loop._iterate import iteration
from jaxcam.hybrid.loop._loop_state import first_state
from jaxcam.models import CamFollower, rpm_to_rad_s


# part of a step for each function of the loop; of nested ones, the innermost counts
PARTS = {
    "step": "stages of the step",
    "error_norm": "stages of the step",
    "jets": "gap, velocity, acceleration, jerk at two points",
    "judge": "checking the flight for events",
    "judge_contact": "checking the contact for release",
    "rest_of_chatter": "summing the remaining impacts of chatter",
    "taylor": "event location, and impact",
    "velocity": "event location, and impact",
    "impact": "event location, and impact",
    "frame": "projection onto the surface",
    "onto": "projection onto the surface",
    "taylor_of_release": "projection onto the surface",
    "after_attempt": "choosing the length of the next step",
}
OTHER = "other operations"


def program():
    """The operations of one attempt, excluding those whose results are unused."""
    system = CamFollower().prepared()
    zero, one = jnp.asarray(0.0), jnp.asarray(1.0)
    plan = Plan.of(system, Settings(), zero, one, stop_period=system.period)
    functions = Functions(system, 2)
    lane = first_state(functions, zero, (jnp.asarray(0.3), zero), one)
    leaves, structure = jax.tree.flatten(jax.tree.map(jnp.asarray, lane))

    def attempt(*leaves):
        after, record = iteration(
            functions, plan, jax.tree.unflatten(structure, leaves)
        )
        return [*jax.tree.leaves(after), record.kind, record.t, *record.after]

    jaxpr = jax.make_jaxpr(attempt)(*leaves).jaxpr
    wanted = [True] * len(jaxpr.outvars)
    return partial_eval.dce_jaxpr(jaxpr, wanted, instantiate=True)[0]


def operations(jaxpr):
    """Names of the operations, including those inside calls, and the functions that use
    them.
    """
    for equation in jaxpr.eqns:
        inner = [p for p in equation.params.values() if hasattr(p, "jaxpr")]
        if inner:
            for call in inner:
                for name, _ in operations(call.jaxpr):
                    yield name, equation
        else:
            yield equation.primitive.name, equation


def part_of(equation) -> str:
    frames = equation.source_info.traceback.frames
    # qualified name, without nested functions
    names = [f.function_name.split(".<")[0].rpartition(".")[2] for f in frames]
    return next((PARTS[name] for name in names if name in PARTS), OTHER)


def attempts(rpm: float = 145.0, settled: int = 50, turns: int = 100) -> str:
    """Describe the attempts and events per turn of the settled motion, which is
    P(inf,1).

    A step length depends on the previous ones, so the number of steps depends on the
    start.
    """
    system = CamFollower(speed=rpm_to_rad_s(rpm))
    starts = np.stack([np.linspace(0.26, 0.3, 8), np.zeros(8)], axis=1)
    settings = Settings(tolerance=1e-9, chatter_depth=1.0)
    first, both = (
        stroboscope(system, starts, number, settings=settings)
        for number in (settled, settled + turns)
    )
    steps = (both.steps - first.steps) / turns
    hits, rests = both.hits[:, settled:].mean(), both.rests[:, settled:].mean()
    return (
        f"{rpm:g} rpm: {steps.min():g} to {steps.max():g} attempts a turn for "
        f"{hits:g} impacts and {rests:g} contacts"
    )


def main() -> None:
    counts, slow = collections.Counter(), collections.Counter()
    for name, equation in operations(program()):
        part = part_of(equation)
        counts[part] += 1
        slow[part] += name in ("div", "sqrt")
    lost = set(PARTS.values()) - set(counts)
    if lost:
        raise SystemExit(f"no operation is counted as {lost}; correct PARTS")
    total = counts.total()
    print("| part | operations | share | divisions, roots |")
    print("| --- | --- | --- | --- |")
    for part, number in counts.most_common():
        print(f"| {part} | {number} | {number / total:.0%} | {slow[part]} |")
    print(f"| all | {total} | | {slow.total()} |")
    print(attempts())


if __name__ == "__main__":
    main()
