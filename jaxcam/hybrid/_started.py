"""Start a run: bind the functions of a system, and compute the first loop state."""

from .loop import first_state, Functions, LoopState, Plan


def started(
    system, settings, t0, state, t1, differentiable, shared: bool = False
) -> tuple[Functions, Plan, LoopState]:
    """Return the functions, the plan and the first loop state of a prepared system."""
    functions = Functions(system, state.shape[0], settings.plain, shared=shared)
    plan = Plan.of(system, settings, t0, t1, differentiable=differentiable)
    x = tuple(state[i] for i in range(state.shape[0]))
    carried = first_state(functions, t0, x, t1, plan.longest_step, plan.repeat)
    return functions, plan, carried
