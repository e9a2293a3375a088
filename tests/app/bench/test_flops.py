"""Operations are counted as one would by hand."""

import math

import numpy as np
import pytest
from ridetune.app.bench.flops import Trace, Traced, operations, square_root
from ridetune.engine.kernels.elementary import sine
from ridetune.engine.kernels.vec3 import cross, dot


@pytest.mark.parametrize(
    ("expression", "count"),
    [
        (lambda a, b: a + b, 1),
        (lambda a, b: a - b - a, 2),
        (lambda a, b: a / b / 2.0, 2),
        (lambda a, b: 1.0 / a, 1),
        (lambda a, b: square_root(a) * b, 2),
        (lambda a, b: a * b + b * a, 2),  # the product once
        (lambda a, b: (a - b) + (b - a), 3),
        (lambda a, b: -a + abs(b), 1),
        (lambda a, b: 0.0 * a + b * 1.0 + 0.0 + b / 1.0 - 0.0, 1),
        (lambda a, b: 0.0 / a + (0.0 - b), 0),
        (lambda a, b: max(a, b) if a > b else min(a, b), 0),
        (lambda a, b: np.float64(3.0) * a + np.float64(2.0), 2),
    ],
)
def test_an_expression_takes_as_many_operations_as_one_counts(expression, count):
    """Oracle: a pencil; the value is that of plain numbers."""
    trace = Trace()
    found = expression(trace.number(1.7), trace.number(0.3))
    assert trace.operations == count
    assert float(found) == pytest.approx(expression(1.7, 0.3), rel=1e-15)


def test_kernels_take_what_their_formulas_say():
    """Oracle: a x b has 6 products and 3 differences, a . b 3 and 2 sums; the sine takes s,
    8 levels of Horner's scheme of a product and a sum each, and angle + angle s series.
    """
    for kernel, arguments, count in ((cross, 6, 9), (dot, 6, 5), (sine, 1, 20)):
        trace = Trace()
        numbers = [trace.number(0.1 + k) for k in range(arguments)]
        vectors = (tuple(numbers[:3]), tuple(numbers[3:])) if arguments == 6 else numbers
        kernel.py_func(*vectors)
        assert trace.operations == count
    angle = Trace().number(0.4)
    assert isinstance(sine.py_func(angle), Traced)
    assert float(sine.py_func(angle)) == pytest.approx(math.sin(0.4), rel=1e-15)


def test_every_mode_is_counted_and_road_look_ups_are_in_it():
    """Oracle: on the road a wheel's cubic and its slope take 14 operations at least, the posts'
    level ground none of them; rims need an arm's angle and a fifth equation on top.
    """
    found = operations()
    assert set(found) == {"road", "posts", "rims"}
    assert found["road"] - found["posts"] >= 4 * 14
    assert found["rims"] > found["posts"]
