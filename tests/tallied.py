"""Figures tallied in the kernels beside those of a history."""

import numpy as np
from numpy.testing import assert_allclose
from ridetune.engine.kernels.histogram import BINS, LOAD_FROM, LOAD_TO, TRAVEL_FROM, TRAVEL_TO
from ridetune.engine.simulation.metrics import metrics

WEIGHTING_ERROR = 5e-4
"""Of a parabola through instants h = 1.25 ms apart, (w h)^3 / 12 at the wheels' 15 Hz, and of the
spectrum of 5 ms samples, into which falls what lies above 100 Hz."""

NO_MOTION = 1e-12
"""m/s2, m, rad: what is left of a motion that symmetry forbids."""

LOAD_ROUNDING = 1e-6
"""N: the mean square of 4 kN is known to 1e-16 of 16e6 N2; the variation is a root of the rest."""


def assert_figures(found, run, vehicle, weighting=WEIGHTING_ERROR):
    """Each figure beside that of the history; percentiles lie in the same bin or the next."""
    expected = {metric.name: metric.value for metric in metrics(run)}
    assert list(found) == list(expected)
    for name, value in expected.items():
        axle = vehicle.front if ".front." in name else vehicle.rear
        if name.endswith((".p01", ".p99")) and "travel" in name:
            width = axle.suspension.mount_height * (TRAVEL_TO - TRAVEL_FROM) / BINS
            assert_allclose(found[name], value, rtol=0, atol=2.0 * width, err_msg=name)
        elif name.endswith((".p01", ".p99")):
            width = np.mean(run[name[:4] + "." + name[5] + "l.load"][:1]) * (LOAD_TO - LOAD_FROM)
            assert_allclose(found[name], value, rtol=0, atol=2.0 * width / BINS, err_msg=name)
        elif ".a_" in name:
            assert_allclose(found[name], value, rtol=weighting, atol=NO_MOTION, err_msg=name)
        elif name.endswith("coefficient"):
            # Over the mean of the samples there, over the mean in time here: the ends weigh half.
            assert_allclose(found[name], value, rtol=2.0 / run.time.size, err_msg=name)
        else:
            least = LOAD_ROUNDING if name.startswith("tyre") else NO_MOTION
            assert_allclose(found[name], value, rtol=1e-9, atol=least, err_msg=name)
