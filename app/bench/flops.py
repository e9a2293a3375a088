"""Floating-point operations of a right-hand side, counted by running it on numbers that notice.

With numba switched off the kernels are plain Python, so a program of its own,
`python -m ridetune.app.bench.flops`, calls them with `Traced` numbers. Counted are the distinct
additions, subtractions, multiplications, divisions and square roots: an operation on the same two
numbers counts once, since a compiler does it once, and one on a literal 0 or 1 not at all.
"""

import json
import math
import os
import subprocess
import sys
from collections.abc import Hashable, Mapping


class Trace:
    """The distinct operations that its numbers have taken part in."""

    def __init__(self) -> None:
        self.operations = 0
        self._results: dict[Hashable, Traced] = {}

    def number(self, value: float) -> "Traced":
        """A number that comes from outside: a state, an input, a parameter."""
        return self.result(value, "given", len(self._results), counted=False)

    def result(self, value: float, *operation: Hashable, counted: bool = True) -> "Traced":
        """Result of an operation, which is told by its sign and the names of what it works on."""
        if operation not in self._results:
            self.operations += counted
            self._results[operation] = Traced(value, self, len(self._results))
        return self._results[operation]


class Traced(float):
    """A float whose operations are counted; comparisons, signs and roundings are not.

    trace : where they are counted; name : its number there
    """

    __array_ufunc__ = None  # numpy's own numbers leave the operation to this class

    def __new__(cls, value: float, *_: object) -> "Traced":
        """The value is all that float knows."""
        return super().__new__(cls, value)

    def __init__(self, _: float, trace: Trace, name: int):
        self.trace, self.name = trace, name

    def __add__(self, other: float) -> float:
        """Sum."""
        if _is(other, 0.0):
            return self
        return self.trace.result(float(self) + float(other), "+", _either(self, other))

    __radd__ = __add__

    def __mul__(self, other: float) -> float:
        """Product."""
        if _is(other, 0.0):
            return 0.0
        if _is(other, 1.0):
            return self
        return self.trace.result(float(self) * float(other), "*", _either(self, other))

    __rmul__ = __mul__

    def __sub__(self, other: float) -> float:
        """Difference."""
        if _is(other, 0.0):
            return self
        return self.trace.result(float(self) - float(other), "-", self.name, _name(other))

    def __rsub__(self, other: float) -> float:
        """Difference from a plain number."""
        if _is(other, 0.0):
            return -self
        return self.trace.result(float(other) - float(self), "-", _name(other), self.name)

    def __truediv__(self, other: float) -> float:
        """Quotient."""
        if _is(other, 1.0):
            return self
        return self.trace.result(float(self) / float(other), "/", self.name, _name(other))

    def __rtruediv__(self, other: float) -> float:
        """Quotient of a plain number."""
        if _is(other, 0.0):
            return 0.0
        return self.trace.result(float(other) / float(self), "/", _name(other), self.name)

    def __neg__(self) -> float:
        """The other sign, which costs a processor nothing of its own."""
        return self.trace.result(-float(self), "sign", self.name, counted=False)

    def __abs__(self) -> float:
        """Magnitude."""
        return self.trace.result(abs(float(self)), "magnitude", self.name, counted=False)


def square_root(x: float) -> float:
    """Square root, counted for a traced number."""
    value = _sqrt(float(x))
    return x.trace.result(value, "sqrt", x.name) if isinstance(x, Traced) else value


_sqrt = math.sqrt


def _is(other: float, literal: float) -> bool:
    return not isinstance(other, Traced) and other == literal


def _name(other: float) -> Hashable:
    """A traced number's name; a plain number is its own."""
    return other.name if isinstance(other, Traced) else ("plain", float(other))


def _either(one: Traced, other: float) -> Hashable:
    """Both operands' names where their order does not matter."""
    return frozenset((one.name, _name(other)))


def operations() -> Mapping[str, int]:
    """Operations of one evaluation for one car, by mode, counted in a process without numba."""
    done = subprocess.run(
        [sys.executable, "-m", __name__],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def _count() -> dict[str, int]:
    """The work of `operations`, where kernels are plain Python.

    The car rolls at 15 m/s in a state like no other, so that nothing vanishes by chance; on the
    road every wheel stands over a cell of it, on the posts' level ground none.
    """
    math.sqrt = square_root  # the kernels take it from there when they are imported
    import numpy as np

    from ...engine.kernels.buffer import ROWS, STAGE, take_car
    from ...engine.kernels.free import free_slopes
    from ...engine.kernels.on_rims import rim_slopes
    from ...engine.roads.road import Road
    from ...engine.simulation.car_rows import car_row
    from ...engine.vehicle_file import reference_vehicles

    def traced(trace, values):
        return np.array([trace.number(float(value)) for value in values], dtype=object)

    def buffer_of(trace):
        state = np.concatenate(
            [[10.0], np.linspace(0.01, 0.02, 7), [15.0], np.linspace(0.1, 0.2, 7)]
        )
        buffer = np.full(ROWS, 0.0, dtype=object)
        buffer[STAGE : STAGE + 16] = traced(trace, state)
        take_car(buffer, 1, 0, traced(trace, car_row(reference_vehicles()["paper"])))
        return buffer

    rough = np.sin(np.arange(1000.0))
    found = {}
    for mode, road in (("road", Road(-5.0, 0.1, rough, rough)), ("posts", Road.flat())):
        trace = Trace()
        cells = traced(trace, road.coefficients.flat).reshape(road.coefficients.shape)
        acting = traced(trace, np.linspace(0.001, 0.002, 16))
        free_slopes(buffer_of(trace), 1, acting, (cells, road.start, road.spacing))
        found[mode] = trace.operations
    trace = Trace()
    rims = traced(trace, [*np.linspace(0.001, 0.002, 12), 1.0, 1.0, 0.1])
    rim_slopes(buffer_of(trace), 1, rims, (1.0,))
    found["rims"] = trace.operations
    return found


if __name__ == "__main__":
    print(json.dumps(_count()))
