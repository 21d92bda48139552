"""Call functions of pytrees row by row, compiled by LLVM or XLA."""

import contextlib
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from ..caches import Cache
from ..programs import program
from ._layout import laid_out, Layout
from ._machine import vector_width
from ._mapped import Mapped
from ._writer import compiled_or_lacking, Lacking


# maximum number of results of a row: each is written by separate instructions
_MOST = 1024


class _Compiled(NamedTuple):
    function: Mapped
    # positions of the results, and their parts that are not arrays
    layout: Layout
    static: Any

    def tree(self, made: np.ndarray):
        """Return the results as a pytree."""
        return eqx.combine(self.layout.tree(made), self.static)


class Numbers(NamedTuple):
    """The numbers of one call: those of the shared arguments, `(k,)`, and those of the
    results, `(count, results)`; and the program, the same object for the same kind of
    arguments.
    """

    given: np.ndarray
    made: np.ndarray
    program: _Compiled


class Rowwise:
    """A function of shared values and of one row, applied to rows that are not traced.

    It is compiled once for each kind of arguments: by LLVM, in a small fraction of the
    time that XLA takes; or by XLA if LLVM is not wanted or lacks an operation.

    **Arguments:** `function(shared, row)` of pytrees, which returns a pytree; and the
    number of rows that are computed at once, by default as many as fit into a register.
    """

    def __init__(self, function: Callable, width: int | None = None):
        self._function = function
        self._width = vector_width() if width is None else width
        self._cache = Cache()

        self._by_xla = program(self._of_rows)

    def __call__(self, shared, rows, count: int, *, compiles: bool):
        """Return the results for `count` rows.

        **Arguments:** the `shared` values, a pytree; the `rows`, a pytree of arrays;
        their number; and whether LLVM `compiles` the function, if it can.

        Returns:
            The result, a pytree of NumPy arrays with `count` rows.
        """
        if compiles:
            with contextlib.suppress(Lacking):
                return self.by_llvm(shared, rows, count)
        # a power of two, so that few lengths are compiled
        size = 1 << max(0, count - 1).bit_length()
        index = np.minimum(np.arange(size), count - 1)
        padded = jax.tree.map(lambda a: np.asarray(a)[index], rows)
        made = self._by_xla(shared, padded, size)
        return jax.tree.map(
            lambda a: np.asarray(a)[:count] if eqx.is_array(a) else a, made
        )

    def _of_rows(self, shared, rows, size: int):
        mapped = eqx.filter_vmap(
            lambda row: self._function(shared, row),
            in_axes=eqx.if_array(0),
            out_axes=eqx.if_array(0),
            axis_size=size,
        )
        return mapped(rows)

    def by_llvm(self, shared, rows, count: int):
        """Return the results for `count` rows, compiled by LLVM.

        **Raises:** `Lacking` with the name of an operation that the backend does not
        have.
        """
        made = self.numbers(shared, rows, count)
        return made.program.tree(made.made)

    def numbers(self, shared, rows=(), count: int = 1) -> Numbers:
        """Return the arguments and the results for `count` rows as numbers.

        **Raises:** `Lacking` with the name of an operation that the backend does not
        have.
        """
        arrays, static = eqx.partition(shared, eqx.is_array)
        given, layout = laid_out(arrays)
        own, row = laid_out(rows, count)
        found = self._compiled(static, layout, row)
        return Numbers(given, found.function(given, own), found)

    def once(self, shared, *, compiles: bool):
        """Return the result of a function that does not use its row."""
        made = self(shared, (), 1, compiles=compiles)
        return jax.tree.map(lambda a: a[0] if isinstance(a, np.ndarray) else a, made)

    def _compiled(self, static, layout: Layout, row: Layout) -> _Compiled:
        leaves, structure = jax.tree.flatten(static)
        kinds = tuple((type(leaf), leaf) for leaf in leaves)
        key = kinds, structure, layout, row
        return compiled_or_lacking(
            self._cache, key, lambda: self._made(static, layout, row)
        )

    def _made(self, static, layout: Layout, row: Layout) -> _Compiled:
        parts = []

        def scalars(numbers, own):
            shared = eqx.combine(layout.tree(numbers), static)
            made = self._function(shared, row.tree(own))
            arrays, rest = eqx.partition(made, eqx.is_array)
            where = Layout.of(arrays)
            parts[:] = [where, rest]
            if where.size > _MOST:
                raise Lacking(f"{where.size} results")
            flat = [leaf.ravel() for leaf in jax.tree.leaves(arrays)]
            return [leaf[k] for leaf in flat for k in range(leaf.shape[0])]

        function = Mapped(scalars, layout.size, row.size, self._width)
        return _Compiled(function, *parts)
