"""Read elements of long arrays from memory, at indices that differ between batch
elements.
"""

from typing import Any, NamedTuple, no_type_check

import llvmlite.ir as ir
import numpy as np

from ..lowering import is_known
from ._elementwise import converted
from ._writer import INT32, INT64, kind_of, Lacking, Place, Writer


# maximum number of computed values that all lookups together store on the stack
_KEPT = 4096


@no_type_check
def looked_up_in_memory(w: Writer, equation, array, starts, dtypes) -> np.ndarray:
    """Emit the slice of an array that starts at unknown indices.

    **Arguments:** the equation, a dynamic slice or a gather of one slice; the elements
    of the array; the start indices, one for each indexed dimension; and the types of
    array and indices.
    """
    slicing = _slicing(equation, array.shape)
    zero = ir.Constant(INT64, 0)
    start, valid = [zero] * array.ndim, None
    for axis, element in zip(slicing.axes, starts, strict=True):
        last = array.shape[axis] - slicing.sizes[axis]
        index = w.number(element, dtypes[1]) if is_known(element) else element
        index = converted(w, index, dtypes[1], np.dtype(np.int64))
        low = w.choose(
            w.builder.icmp_signed("<", index, w.like(index, 0)),
            w.like(index, 0),
            index,
        )
        beyond = w.builder.icmp_signed(">", low, w.like(low, last))
        start[axis] = w.choose(beyond, w.like(low, last), low)
        if slicing.fill is not None:
            inside = w.builder.icmp_signed("==", start[axis], index)
            valid = w.both(valid, inside)
    place = _place_of(w, array.ravel(), dtypes[0])
    strides = np.cumprod([1, *array.shape[:0:-1]])[::-1]
    found = np.empty(slicing.sizes, dtype=object)
    for offsets in np.ndindex(*slicing.sizes):
        flat = zero
        for index, offset, stride in zip(start, offsets, strides, strict=True):
            index = w.builder.add(index, w.like(index, offset))
            index = w.builder.mul(index, w.like(index, int(stride)))
            flat = w.builder.add(*w.alike([flat, index]))
        value = _loaded(w, place, flat, dtypes[0])
        if valid is not None:
            outside = w.number(slicing.fill, dtypes[0])
            value = w.choose(valid, value, outside)
        found[offsets] = value
    kept = [k for k in range(array.ndim) if k not in slicing.collapsed]
    return found.reshape([slicing.sizes[k] for k in kept])


class _Slicing(NamedTuple):
    sizes: tuple[int, ...]
    # dimensions that are indexed, and dimensions that the result does not have
    axes: tuple[int, ...]
    collapsed: tuple[int, ...]
    # value returned outside the array; `None` if the nearest slice is returned instead
    fill: Any


@no_type_check
def _slicing(equation, shape) -> _Slicing:
    params = equation.params
    sizes = tuple(params["slice_sizes"])
    if equation.primitive.name == "dynamic_slice":
        return _Slicing(sizes, tuple(range(len(shape))), (), None)
    numbers = params["dimension_numbers"]
    fills = "FILL" in str(params["mode"]).upper()
    fill = fill_of(equation) if fills else None
    axes, collapsed = numbers.start_index_map, numbers.collapsed_slice_dims
    return _Slicing(sizes, tuple(axes), tuple(collapsed), fill)


def fill_of(equation):
    """Return the value that a gather returns outside the array."""
    dtype, value = equation.outvars[0].aval.dtype, equation.params.get("fill_value")
    if value is None:
        inexact = np.issubdtype(dtype, np.inexact)
        value = np.nan if inexact else np.iinfo(dtype).min if dtype != bool else True
    return np.dtype(dtype).type(value)


@no_type_check
def _place_of(w: Writer, elements, dtype) -> Place:
    """Return where the elements are in memory; computed elements that are not there
    yet are stored first.
    """
    if all(map(is_known, elements)):
        return Place(_constant(w, elements, dtype), 0)
    first = w.places.get(id(elements[0]))
    if first is not None:
        wanted = (first._replace(index=first.index + k) for k in range(len(elements)))
        pairs = zip(elements, wanted, strict=True)
        if all(w.places.get(id(element)) == place for element, place in pairs):
            return first
    return _stored(w, elements, dtype)


@no_type_check
def _constant(w: Writer, elements, dtype):
    numbers = np.array(list(elements), dtype)
    key = str(dtype), numbers.tobytes()
    known = w.constants.get(key)
    if known is None:
        kind = ir.ArrayType(kind_of(dtype), len(elements))
        name = f"table{len(w.constants)}"
        known = w.constants[key] = ir.GlobalVariable(w.module, kind, name)
        known.initializer = ir.Constant(kind, [w.number(e, dtype) for e in numbers])
        known.global_constant, known.linkage = True, "internal"
    zero = ir.Constant(INT64, 0)
    return w.builder.gep(known, [zero, zero])


@no_type_check
def _stored(w: Writer, elements, dtype) -> Place:
    kind = kind_of(dtype)
    w.stored += len(elements)
    if kind == ir.IntType(1) or w.stored > _KEPT:
        raise Lacking(f"lookups in a computed table of {len(elements)} {dtype}")
    room = w.memory(w.vector(kind), len(elements))
    for k, element in enumerate(elements):
        value = w.number(element, dtype) if is_known(element) else element
        w.builder.store(w.spread(value), w.builder.gep(room, [ir.Constant(INT64, k)]))
    pointer = w.builder.bitcast(room, kind.as_pointer())
    return Place(pointer, 0, ir.Constant(INT64, w.width), ir.Constant(INT64, 0))


@no_type_check
def _loaded(w: Writer, place: Place, flat, dtype):
    """Load the element at index `flat`, which may differ between batch elements."""
    b, shared = w.builder, place.stride is None

    def of(index, lane: int):
        index = b.add(index, ir.Constant(INT64, place.index))
        if not shared:
            index = b.add(b.mul(index, place.stride), place.first)
            index = b.add(index, ir.Constant(INT64, lane))
        return b.load(b.gep(place.pointer, [index]))

    if w.width == 1 or (shared and not isinstance(flat.type, ir.VectorType)):
        return of(flat, 0)
    flat = w.spread(flat)
    made = ir.Constant(w.vector(kind_of(dtype)), ir.Undefined)
    for lane in range(w.width):
        at = ir.Constant(INT32, lane)
        made = b.insert_element(made, of(b.extract_element(flat, at), lane), at)
    return made
