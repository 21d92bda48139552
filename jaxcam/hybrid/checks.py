"""Detect invalid input; each message says how to fix it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.errors import (
    ConcretizationTypeError,
    TracerArrayConversionError,
    TracerIntegerConversionError,
)

from ._automaton import HybridAutomaton
from ._identity import digest_of, structure_of
from ._prepared import prepared
from ._settings import Settings
from ._switched import SwitchedSystem
from ._system import HybridSystem
from .backend import Rowwise
from .caches import Latest
from .loop import starts_behind
from .programs import is_traced
from .surface import check_restitution, restitutions


NEEDS_VALUES = (
    ConcretizationTypeError,
    TracerArrayConversionError,
    TracerIntegerConversionError,
)
"""Errors raised by a function that JAX cannot trace."""


def needs_values(name: str) -> str:
    """Return the sentence about a function that raises one of `NEEDS_VALUES`.

    Args:
        name: Name of the function, as the sentence begins.

    Returns:
        The sentence, without a full stop.
    """
    return (
        f"{name} needs the values of time or state, which are not known during "
        "compilation; write it with jax.numpy (jnp.cos, not np.cos or math.cos), and "
        "use jnp.where instead of if; a force with a kink (a second spring beyond a "
        "gap, a soft stop, dry friction) needs a SwitchedSystem: see Switching surfaces"
    )


def refuse_tracers(name: str, instead: str, *arguments) -> None:
    """Raise `ValueError` if an argument of a function that JAX cannot trace is traced.

    Args:
        name: Name of the function.
        instead: The function to use instead.
        *arguments: The arguments of the call.
    """
    if is_traced(arguments):
        raise ValueError(
            f"{name} is driven from Python and cannot be traced by jit, vmap, jvp or "
            f"grad; use {instead} there"
        )


def check_start(system: HybridSystem, settings: Settings, t0, state, t1) -> None:
    """Raise `ValueError` if an argument is invalid or the run cannot start."""
    check_arguments(system, settings, t0, state, t1)
    check_gaps(system, settings, t0, state)


def check_arguments(system: HybridSystem, settings: Settings, t0, state, t1) -> None:
    """Raise `ValueError` for an invalid system, settings, times or state."""
    if _CHECKED.get(settings) is None:
        settings.check()
        _CHECKED.keep(settings, True)
    if state.ndim != 1:
        raise ValueError(
            f"state has shape {state.shape}; pass one vector, and use jax.vmap for many"
        )
    if not np.all(np.isfinite(state)):
        raise ValueError(
            f"state is {np.asarray(state).tolist()}; every component must be finite"
        )
    number = np.size(settings.absolute) if settings.absolute is not None else 1
    if number not in (1, len(state)):
        raise ValueError(
            f"absolute has {number} numbers, but the state has {len(state)} "
            "components; give one number, or one for each component"
        )
    if not (np.isfinite(t0) and np.isfinite(t1)):
        raise ValueError("t0 and t1 must be finite times in seconds")
    if float(t1) < float(t0):
        raise ValueError(
            f"t1 = {float(t1):g} s is before t0 = {float(t0):g} s; time runs forward, "
            "so interchange them"
        )
    check_system(system, t0, state, settings)


def check_gaps(system: HybridSystem, settings: Settings, t0, state) -> None:
    """Raise `ValueError` for a state that penetrates a constraint, or at which a gap is
    not finite.
    """
    case = prepared(system), t0, state
    behind, values = _STARTS_BEHIND.once(case, compiles=settings.compiles)
    if not np.all(np.isfinite(values)):
        raise ValueError("the gap is not finite at t0; check the state and parameters")
    if behind:
        # only such systems have a release point
        released = system.period is not None and (len(state), np.size(values)) == (2, 1)
        hint = ", or pass state=None to start at the release point" if released else ""
        raise ValueError(
            f"gap is negative ({np.min(values):.1e}) at t0; start with every gap at "
            f"zero or above{hint}"
        )


# compiled functions of (system, time, state)
_STARTS_BEHIND = Rowwise(lambda case, _: starts_behind(*case), width=1)
_RESTITUTIONS = Rowwise(lambda case, _: restitutions(*case), width=1)


# the settings that were checked last
_CHECKED = Latest()
# keys of systems that have passed the checks: of shapes alone, and of all numbers. Such
# systems are not checked again, because a check takes as long as a short run
_WELL_SHAPED: set = set()
_SOUND: set = set()
_MANY = 1000
# the number of components of the state with which the same system was checked last
_LATEST = Latest()


def check_system(system, t0, state, settings: Settings) -> None:
    """Raise `ValueError` for an invalid parameter or function of the system."""
    if _LATEST.get(system) == len(state):
        return
    structure = structure_of(system)
    signature = None if structure is None else (structure, state.shape)
    numbers = signature, digest_of(system)
    if signature is not None and numbers in _SOUND:
        _LATEST.keep(system, len(state))
        return
    for leaf in jax.tree.leaves(eqx.filter(system, eqx.is_inexact_array)):
        if not np.all(np.isfinite(leaf)):
            raise ValueError(
                "a parameter of the system is not finite; print the system to see which"
            )
    ready = prepared(system)
    if signature not in _WELL_SHAPED:
        if isinstance(ready, HybridAutomaton):
            _check_modes(ready, t0, state)
        _check_shapes(ready, t0, state)
    system.check()
    if isinstance(system, SwitchedSystem):
        _check_switches(system)
    found = _RESTITUTIONS.once((ready, t0, state), compiles=settings.compiles)
    check_restitution(system, found)
    if signature is not None:
        _WELL_SHAPED.add(signature)
        if len(_SOUND) >= _MANY:
            _SOUND.clear()
        _SOUND.add(numbers)


def missing_method(kind: type[HybridSystem]) -> str | None:
    """Return the name of a method that a class must still define, or `None`.

    Args:
        kind: The class. A `gap` needs an `impact`, and the other way round; names of
            constraints need both.

    Returns:
        The name of the method.

    Examples:
        >>> from jaxcam.hybrid.checks import missing_method
        >>> class Wall(jaxcam.HybridSystem):
        ...     def vector_field(self, t, state):
        ...         return -state
        ...     def gap(self, t, state):
        ...         return state[0]
        >>> missing_method(Wall)
        'impact'
    """
    if kind.__abstractmethods__:
        return min(kind.__abstractmethods__)
    bases = HybridSystem, SwitchedSystem
    gap, impact = (
        all(getattr(kind, name) is not getattr(base, name) for base in bases)
        for name in ("gap", "impact")
    )
    if not gap and (impact or kind.constraint_names):
        return "gap"
    return "impact" if gap and not impact else None


def _check_switches(system: SwitchedSystem) -> None:
    if not np.all(np.asarray(system.hysteresis) >= 0):
        raise ValueError(f"hysteresis is {system.hysteresis}; it cannot be negative")
    if not np.all(np.asarray(system.holding) >= 1):
        raise ValueError(f"holding is {system.holding}; it must be at least one")


def _check_modes(system: HybridAutomaton, t0, state) -> None:
    """Raise `ValueError` for an undefined mode, one that no transition meets, or an
    array of a wrong shape.
    """
    name, transitions = type(system).__name__, len(system.transitions)
    met = {mode for pair in system.transitions for mode in pair}
    if unknown := sorted(met - set(system.modes)):
        raise ValueError(
            f"transitions of {name} name the modes {', '.join(unknown)}, which `modes` "
            f"does not contain; it contains {', '.join(system.modes)}"
        )
    if unused := [mode for mode in system.modes if mode not in met]:
        raise ValueError(
            f"no transition of {name} begins or ends in {', '.join(unused)}; add a "
            "transition, or leave the mode out"
        )
    if loops := [before for before, after in system.transitions if before == after]:
        raise ValueError(
            f"a transition of {name} leads from {loops[0]} to {loops[0]}; add a second "
            "mode with the same vector field"
        )
    n = state.shape[0]
    if lost := sorted(set(system.held) - set(system.modes)):
        raise ValueError(
            f"held of {name} names the modes {', '.join(lost)}, which `modes` does not "
            f"contain; it contains {', '.join(system.modes)}"
        )
    if far := sorted(
        {k for places in system.held.values() for k in places} - {*range(n)}
    ):
        raise ValueError(
            f"held of {name} contains the index {far[0]}; the state has {n} components"
        )
    own = _shape(system, "surfaces", t0, state)
    sides = jax.ShapeDtypeStruct((own.size,), jnp.float64)
    for method, more, shape, each in (
        ("fields", (sides,), (len(system.modes), n), "mode"),
        ("guards", (), (transitions,), "transition"),
        ("resets", (), (transitions, n), "transition"),
        ("start_mode", (), (), ""),
    ):
        found = _shape(system, method, t0, state, *more).shape
        if found != shape:
            rows = f"one row for each {each}" if each else "one index"
            raise ValueError(
                f"{method} of {name} returns shape {found}; return {shape}, {rows}"
            )


def _check_shapes(system, t0, state) -> None:
    missing = missing_method(type(system))
    if missing is not None:
        raise ValueError(
            f"{type(system).__name__} has constraints, but no {missing}; add that "
            "method, or leave out gap, impact and constraint_names"
        )
    n = state.shape[0]
    wanted = len(system.state_names)
    if wanted and wanted != n:
        names = ", ".join(system.state_names)
        raise ValueError(
            f"state has {n} components but {type(system).__name__} has {wanted}: "
            f"{names}"
        )
    rate = _shape(system, "vector_field", t0, state)
    if rate.shape != (n,):
        raise ValueError(
            f"vector_field returns shape {rate.shape} for a state of shape {(n,)}; "
            "return one rate for each component, such as jnp.stack([...])"
        )
    gap = _shape(system, "gap", t0, state)
    if len(gap.shape) > 1:
        raise ValueError(
            f"gap returns shape {gap.shape}; return a scalar or a vector of gaps"
        )
    if gap.shape == (0,) and not isinstance(system, SwitchedSystem):
        raise ValueError(
            "gap returns no values; leave out gap and impact if there are no "
            "constraints"
        )
    after = _shape(system, "impact", t0, state)
    if after.shape != (*gap.shape, n):
        raise ValueError(
            f"impact returns shape {after.shape}, but gap has shape {gap.shape} and "
            f"the state {(n,)}; return shape {(*gap.shape, n)}, one row for each gap"
        )
    made_by = {"vector_field": rate, "gap": gap, "impact": after}
    if isinstance(system, SwitchedSystem):
        made_by |= _switched_shapes(system, t0, state)
    for name, made in made_by.items():
        if made.dtype != jnp.float64:
            raise ValueError(
                f"{name} returns {made.dtype}; use 64-bit floats (importing jaxcam "
                "turns them on)"
            )


def _switched_shapes(system: SwitchedSystem, t0, state) -> dict:
    """Check the shapes that the methods for switching surfaces return, and return these
    shapes by the name of the method.
    """
    switch = _shape(system, "switching", t0, state)
    if len(switch.shape) > 1 or switch.shape == (0,):
        raise ValueError(
            f"switching returns shape {switch.shape}; return a scalar or a vector, one "
            "number for each surface"
        )
    k, n = max(switch.size, 1), state.shape[0]
    sides = _shape(system, "sides", t0, state)
    if sides.shape != (k,):
        raise ValueError(
            f"sides returns shape {sides.shape} for {k} surfaces; return {(k,)}, +1 or "
            "-1 for each"
        )
    given = jax.ShapeDtypeStruct((k,), jnp.float64)
    after = _shape(system, "reset", t0, state, given)
    if after.shape != (*switch.shape, n):
        raise ValueError(
            f"reset returns shape {after.shape} but switching has shape {switch.shape} "
            f"and the state {(n,)}; return shape {(*switch.shape, n)}, one row for "
            "each surface"
        )
    for name in ("hysteresis", "holding"):
        given = np.shape(getattr(system, name))
        if given not in ((), (k,)):
            raise ValueError(
                f"{name} has shape {given}; give a number, or one for each of the {k} "
                "surfaces"
            )
    return {"switching": switch, "sides": sides, "reset": after}


def _shape(system, name, *arguments):
    """Return the shape and type of the result of a method of the system."""
    try:
        made = jax.eval_shape(getattr(system, name), *arguments)
    except NEEDS_VALUES as error:
        raise ValueError(needs_values(name)) from error
    if not isinstance(made, jax.ShapeDtypeStruct):
        raise ValueError(
            f"{name} returns a {type(made).__name__}; return one array, "
            "such as jnp.stack([...])"
        )
    return made
