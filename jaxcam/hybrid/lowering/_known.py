"""Numbers that are known while a function is traced, and arithmetic on them.

Most come from the zeros and ones of derivatives. They are computed in numpy, because
otherwise each operation would be a program to compile.
"""

from typing import no_type_check

import jax
import jax.numpy as jnp
import numpy as np


_NUMPY = {
    "abs": np.abs,
    "add": np.add,
    "add_any": np.add,
    "and": np.bitwise_and,
    "div": np.divide,
    "eq": np.equal,
    "ge": np.greater_equal,
    "gt": np.greater,
    "le": np.less_equal,
    "lt": np.less,
    "max": np.maximum,
    "min": np.minimum,
    "mul": np.multiply,
    "ne": np.not_equal,
    "neg": np.negative,
    "not": np.invert,
    "or": np.bitwise_or,
    "sub": np.subtract,
}


# maximum number of arguments of `numpy.choose`, including the selector
_CASES = 32


FOLDED = frozenset(_NUMPY)
"""Operations on known scalars that `folded` computes."""


def folded(name: str, scalars):
    """Return the result of an operation in `FOLDED` on known scalars."""
    with np.errstate(all="ignore"):
        return _NUMPY[name](*scalars)


# called for every scalar; see `_jaxprs.py`
@no_type_check
def is_known(element) -> bool:
    return isinstance(element, (np.generic, bool, int, float))


def join_known(elements: np.ndarray):
    """Return an array of elements that are known while tracing."""
    flat = [np.asarray(e) for e in elements.ravel()]
    return np.stack(flat).reshape(elements.shape) if flat else np.zeros(elements.shape)


def computed(equation, arrays) -> list[np.ndarray]:
    """Return the result of an operation on known numbers, computed while tracing."""
    name, outputs = equation.primitive.name, equation.outvars
    params = equation.params
    with np.errstate(all="ignore"):
        if name in _NUMPY:
            made = [_NUMPY[name](*arrays)]
        elif name == "convert_element_type":
            made = arrays
        elif name == "reduce_sum":
            made = [np.sum(arrays[0], axis=tuple(params["axes"]))]
        elif name == "select_n" and len(arrays) <= _CASES:
            made = [np.choose(arrays[0].astype(int), arrays[1:], mode="clip")]
        elif name == "iota":
            made = [np.indices(params["shape"])[params["dimension"]]]
        else:
            made = _compiled(equation, arrays)
    return [
        np.asarray(m, dtype=o.aval.dtype) for m, o in zip(made, outputs, strict=True)
    ]


def _compiled(equation, arrays):
    primitive = equation.primitive
    with jax.ensure_compile_time_eval():
        params = primitive.get_bind_params(equation.params)
        made = primitive.bind(*map(jnp.asarray, arrays), **params)
    return made if primitive.multiple_results else [made]
