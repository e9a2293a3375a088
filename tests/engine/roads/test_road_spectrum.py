"""Road spectra against the roads they are of."""

import numpy as np
from numpy.testing import assert_allclose
from ridetune.engine.roads.iso8608 import CLASSES, iso_road
from ridetune.engine.roads.road import Road
from ridetune.engine.roads.road_spectrum import road_spectra


def test_a_class_has_its_own_spectrum():
    """Oracle: Gd(n) = Gd(n0) (n/n0)^-2. 400 half-overlapping windows leave some 6 % of scatter a
    line, less in bands of several; Hann windows smear the slope at their lowest lines.
    """
    road = iso_road([("A", 0.0), ("C", 5000.0)], 15_000.0, seed=4)
    for found, letter in zip(road_spectra(road, [10.0, 4990.0, 14_990.0]), ("A", "C"), strict=True):
        inside = (found.frequency > 0.1) & (found.frequency < 2.0)
        expected = CLASSES[letter] * (found.frequency[inside] / 0.1) ** -2.0
        for side in (found.left, found.right):
            ratio = side[inside] / expected
            assert_allclose(np.exp(np.mean(np.log(ratio))), 1.0, rtol=0.08)
            assert_allclose(ratio, 1.0, atol=0.4)


def test_flat_and_short_sections_have_none():
    assert road_spectra(Road.flat(), [0.0, 500.0]) == ()
    road = iso_road([("B", 0.0)], 100.0, seed=1)
    assert road_spectra(road, [3.0, 12.0]) == ()
