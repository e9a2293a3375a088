"""Plumbing that turns the scalar physics into vector code: LANES cars side by side.

All numbers of a group of cars live in ONE flat buffer, row r of car j at buffer[r * LANES + j].
With a single base pointer and LANES known to the compiler a loop over j has no aliasing to
disprove and becomes AVX code; with one array a quantity it stays scalar. LANES is the length of a
tuple argument, which is part of its type: 1 for one car, 8 for batches.

Records are loaded from and stored to consecutive rows, one row a field.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import config
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

ONE_CAR = (0,)
"""Lanes argument for a single car."""

BATCH = (0,) * 8
"""Lanes argument for a batch: eight cars fill one AVX-512 or two AVX2 registers."""


def _address(context, builder, signature, args, row):
    """Pointer to row `first + row` of the lane."""
    buffer, first, lanes, lane = args[:4]
    array = make_array(signature.args[0])(context, builder, buffer)
    kind = first.type
    index = builder.add(builder.mul(builder.add(first, ir.Constant(kind, row)), lanes), lane)
    return builder.gep(array.data, [index])


def loader(record: Any) -> Callable[..., Any]:
    """Function (buffer, first row, LANES, lane) -> record."""
    size = len(record._fields)
    # Numba makes its settings at run time, out of sight of the type checker.
    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]
        return lambda buffer, first, lanes, lane: record(
            *(buffer[(first + row) * lanes + lane] for row in range(size))
        )

    @intrinsic
    def load(_context, buffer, first, lanes, lane):
        kind = types.NamedUniTuple(types.float64, size, record)

        def generate(context, builder, signature, args):
            values = [
                builder.load(_address(context, builder, signature, args, row))
                for row in range(size)
            ]
            return context.make_tuple(builder, signature.return_type, values)

        return kind(buffer, types.intp, types.intp, types.intp), generate

    return load


def storer(record: Any) -> Callable[..., None]:
    """Function (buffer, first row, LANES, lane, record) that stores the record's fields."""
    size = len(record._fields)
    # Numba makes its settings at run time, out of sight of the type checker.
    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]

        def store_in_python(buffer, first, lanes, lane, value):
            for row in range(size):
                buffer[(first + row) * lanes + lane] = value[row]

        return store_in_python

    @intrinsic
    def store(_context, buffer, first, lanes, lane, value):
        def generate(context, builder, signature, args):
            for row in range(size):
                item = builder.extract_value(args[4], row)
                builder.store(item, _address(context, builder, signature, args, row))
            return context.get_dummy_value()

        return types.void(buffer, types.intp, types.intp, types.intp, value), generate

    return store
