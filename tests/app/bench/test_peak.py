"""The kernel whose speed is the processor's peak computes what it says."""

import pytest
from ridetune.app.bench.peak import SHAPES, chains_kernel


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("turns", [1, 1000])
def test_chains_end_where_the_recurrence_ends(shape, turns):
    """Oracle: x = a^n x0 + b (1 - a^n) / (1 - a), summed over x0 = 1 ... N."""
    width, chains = shape
    a, b, number = 0.999, 0.25, width * chains
    power = a**turns
    expected = power * number * (number + 1) / 2 + number * b * (1 - power) / (1 - a)
    assert chains_kernel(width, chains)(turns, a, b) == pytest.approx(expected, rel=1e-12)
