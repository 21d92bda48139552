"""Wrap a program as one primitive that JAX transforms as a unit.

JAX's linearisation splits a program into known and linear parts, and drops unused
results. XLA aborts if results of a loop compiled as one kernel (`_one_kernel.py`) are
dropped, and a loop cannot be run backward. This module wraps a program as one
primitive. `vmap` and `jvp` yield another such primitive. Linearisation evaluates the
function and then its derivative. A gradient is assembled from one forward derivative
per input.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax._src.interpreters.ad import jvp_jaxpr
from jax._src.interpreters.batching import batch_jaxpr
from jax.core import Tracer
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend.core import ClosedJaxpr, jaxpr_as_fun, Literal, Primitive
from jax.flatten_util import ravel_pytree
from jax.interpreters import ad, batching, mlir, partial_eval

from ._jaxprs import fits_kernel


# attribute of a call: the CPU backend compiles it and the calls inside it as one
# function
_ONE_FUNCTION = {"inlineable": "false", "xla_cpu_small_call": "true"}


class Program(NamedTuple):
    """The content of the primitive; hashable, and compared by identity of the jaxpr."""

    jaxpr: ClosedJaxpr
    # whether the CPU backend compiles it as one function
    kernel: bool
    # the program of which this one is the derivative: its inputs and outputs come first
    # here, followed by the tangents
    plain: "Program | None" = None


def whole(function: Callable, *, kernel: dict[str, str] | None = None) -> Callable:
    """Wrap `function` as one primitive, which JAX transforms as a unit.

    **Arguments:** a function of pytrees, whose non-array leaves are static; and
    `kernel`, attributes of the calls inside. If these are given, the CPU backend
    compiles the primitive as one function, if it can.

    Returns:
        A function of the same arguments with the same results (arrays and static
            leaves). It can be compiled, batched and differentiated in both modes, any
            number of times. A gradient costs as much as forward derivatives with
            respect to all differentiation variables.
    """

    def call(*arguments):
        arrays, static = eqx.partition(arguments, eqx.is_array)
        kept = []

        def of_arrays(arrays):
            made, rest = eqx.partition(
                function(*eqx.combine(arrays, static)), eqx.is_array
            )
            kept.append(rest)
            return made

        # calls take the attributes that are set when they are traced
        with set_xla_metadata(**(kernel or {})):
            closed, shape = jax.make_jaxpr(of_arrays, return_shape=True)(arrays)
        if kernel and not fits_kernel(closed.jaxpr):
            return whole(function)(*arguments)
        jaxpr, captured = _open(closed)
        made = whole_p.bind(
            *captured, *jax.tree.leaves(arrays), program=Program(jaxpr, bool(kernel))
        )
        made = jax.tree.unflatten(jax.tree.structure(shape), made)
        return eqx.combine(made, kept[-1])

    return call


def while_loop(goes_on: Callable, body: Callable, start):
    """Run `jax.lax.while_loop` with support for gradients."""
    return whole(lambda start: jax.lax.while_loop(goes_on, body, start))(start)


def has_program(equation) -> ClosedJaxpr | None:
    """Return the program inside an operation created by `whole`; otherwise `None`."""
    if equation.primitive is not whole_p:
        return None
    return equation.params["program"].jaxpr


def _open(closed: ClosedJaxpr):
    """Return the jaxpr with captured outer tracers as its first inputs."""
    jaxpr = closed.jaxpr
    pairs = list(zip(jaxpr.constvars, closed.consts, strict=True))
    traced = [(v, c) for v, c in pairs if isinstance(c, Tracer)]
    fixed = [(v, c) for v, c in pairs if not isinstance(c, Tracer)]
    opened = jaxpr.replace(
        constvars=[v for v, _ in fixed],
        invars=[*(v for v, _ in traced), *jaxpr.invars],
        debug_info=jaxpr.debug_info.with_unknown_names(),
    )
    return ClosedJaxpr(opened, [c for _, c in fixed]), [c for _, c in traced]


whole_p = Primitive("whole")
whole_p.multiple_results = True


@functools.lru_cache(maxsize=256)
def _compiled(program: Program) -> Callable:
    return jax.jit(functools.partial(whole_p.bind, program=program))


@whole_p.def_impl
def _evaluate(*arguments, program: Program):
    return _compiled(program)(*arguments)


@whole_p.def_abstract_eval
def _shapes(*_, program: Program):
    return program.jaxpr.out_avals


def _inlined(*arguments, program: Program):
    return jaxpr_as_fun(program.jaxpr)(*arguments)


def _on_cpu(*arguments, program: Program):
    if not program.kernel or not fits_kernel(program.jaxpr.jaxpr):
        return _inlined(*arguments, program=program)

    def with_arguments(*arguments):
        arguments = jax.lax.optimization_barrier(arguments)
        return jaxpr_as_fun(program.jaxpr)(*arguments), arguments

    # XLA aborts on such a call if optimisation leaves an argument unused; therefore,
    # all arguments are also results, and all results are kept. It also aborts if an
    # argument is a constant, which may happen in a loop around the call; hence the
    # barriers
    arguments = jax.lax.optimization_barrier(arguments)
    with set_xla_metadata(**_ONE_FUNCTION):
        made = jax.jit(with_arguments)(*arguments)
    return jax.lax.optimization_barrier(made)[0]


mlir.register_lowering(whole_p, mlir.lower_fun(_inlined, multiple_results=True))
mlir.register_lowering(
    whole_p, mlir.lower_fun(_on_cpu, multiple_results=True), platform="cpu"
)


def _batched(program: Program, axis, mapped: list[bool], wanted: list[bool]):
    """Return the program of a batch, and which outputs are batched: all that are
    `wanted`, and possibly others.

    A program and the one from which it was derived agree on which of their common
    outputs are batched.
    """
    jaxpr, out = batch_jaxpr(program.jaxpr, axis, mapped, list(wanted))
    if program.plain is None:
        return program._replace(jaxpr=jaxpr), list(out)
    inputs, outputs = _sizes(program.plain)
    plain, first = _batched(program.plain, axis, mapped[:inputs], out[:outputs])
    if first != list(out[:outputs]):
        wanted = [*first, *out[outputs:]]
        jaxpr, out = batch_jaxpr(program.jaxpr, axis, mapped, wanted)
    return Program(jaxpr, program.kernel, plain), list(out)


def _batch(axis, arguments, dimensions, *, program: Program):
    mapped = [d is not None for d in dimensions]
    arguments = [
        jnp.moveaxis(a, d, 0) if m else a
        for a, d, m in zip(arguments, dimensions, mapped, strict=True)
    ]
    none = [False] * _sizes(program)[1]
    program, out = _batched(program, axis, mapped, none)
    made = whole_p.bind(*arguments, program=program)
    return made, [0 if m else None for m in out]


batching.fancy_primitive_batchers[whole_p] = _batch


def _jvp(primals, tangents, *, program: Program):
    moved = [type(t) is not ad.Zero for t in tangents]
    jaxpr, moves = jvp_jaxpr(program.jaxpr, moved, instantiate=False)
    given = [t for t, m in zip(tangents, moved, strict=True) if m]
    both = Program(jaxpr, program.kernel, plain=program)
    made = whole_p.bind(*primals, *given, program=both)
    _, outputs = _sizes(program)
    rest = iter(made[outputs:])
    shapes = zip(moves, program.jaxpr.out_avals, strict=True)
    return made[:outputs], [
        next(rest) if m else ad.Zero(aval.to_tangent_aval()) for m, aval in shapes
    ]


ad.primitive_jvps[whole_p] = _jvp


def _partly_known(trace, *tracers, program: Program):
    """Apply partial evaluation, in which values are known and tangents are unknown."""
    known = [tracer.is_known() for tracer in tracers]
    if program.plain is None or all(known):
        return trace.default_process_primitive(whole_p, tracers, {"program": program})
    inputs, outputs = _sizes(program.plain)
    if not all(known[:inputs]):
        return trace.default_process_primitive(whole_p, tracers, {"program": program})
    values = [tracer.pval.get_known() for tracer in tracers[:inputs]]
    made = whole_p.bind(*values, program=program.plain)
    only = {"program": _without(program, outputs)}
    return [*made, *trace.default_process_primitive(whole_p, tracers, only)]


partial_eval.custom_partial_eval_rules[whole_p] = _partly_known


def _partly_known_equation(saveable, unknown, instantiated, equation):
    """Apply partial evaluation to an equation under `jax.checkpoint`."""
    del saveable
    program = equation.params["program"]
    inputs, outputs = (0, 0) if program.plain is None else _sizes(program.plain)
    if any(unknown[:inputs]):
        inputs = outputs = 0
    known = None
    if not any(unknown):
        known, outputs = equation, len(equation.outvars)
    elif outputs:
        known = equation.replace(
            invars=equation.invars[:inputs],
            outvars=equation.outvars[:outputs],
            params={"program": program.plain},
        )
    moving = [k >= outputs for k in range(len(equation.outvars))]
    pairs = zip(equation.invars, instantiated, strict=True)
    needed = [v for v, there in pairs if not there and not isinstance(v, Literal)]
    return known, equation, moving, [True] * len(moving), needed


partial_eval.partial_eval_jaxpr_custom_rules[whole_p] = _partly_known_equation


@functools.lru_cache(maxsize=256)
def _without(program: Program, first: int) -> Program:
    """Return the program without its first outputs, although it still computes
    them.
    """
    jaxpr = program.jaxpr.jaxpr
    jaxpr = jaxpr.replace(
        outvars=jaxpr.outvars[first:], debug_info=jaxpr.debug_info.with_unknown_names()
    )
    return Program(program.jaxpr.replace(jaxpr=jaxpr), program.kernel)


def _transpose(cotangents, *arguments, program: Program):
    """Compute the cotangents of the inputs in which the program is linear, from its
    full matrix.
    """
    linear = [ad.is_undefined_primal(a) for a in arguments]
    zeros = [
        jnp.zeros(a.aval.shape, a.aval.dtype) if unknown else None
        for a, unknown in zip(arguments, linear, strict=True)
    ]
    flat, shaped = ravel_pytree(zeros)

    def along(direction):
        pairs = zip(arguments, shaped(direction), linear, strict=True)
        made = whole_p.bind(
            *(part if unknown else a for a, part, unknown in pairs), program=program
        )
        total = jnp.zeros((), flat.dtype)
        for cotangent, moved in zip(cotangents, made, strict=True):
            if type(cotangent) is not ad.Zero:
                # the derivative of an unused result may be infinite
                counts = jnp.where(cotangent == 0, 0, cotangent * moved)
                total = total + jnp.sum(counts.astype(flat.dtype))
        return total

    return shaped(jax.vmap(along)(jnp.eye(flat.size, dtype=flat.dtype)))


ad.primitive_transposes[whole_p] = _transpose


def _sizes(program: Program) -> tuple[int, int]:
    return len(program.jaxpr.in_avals), len(program.jaxpr.out_avals)
