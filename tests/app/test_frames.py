"""Histories on the wire: the binary form read back, peaks kept when thinned out."""

import json
import struct

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from ridetune.app import frames
from ridetune.app.errors import NotAcceptable
from ridetune.engine.errors import MeasurementError
from ridetune.engine.run import Run


@pytest.fixture
def run() -> Run:
    rng = np.random.default_rng(1)
    time = np.linspace(0.0, 10.0, 2003)
    return Run("noise", time, {"chassis.z": rng.normal(size=2003), "chassis.roll": time**2})


def read_binary(data: bytes) -> tuple[dict, dict[str, np.ndarray]]:
    """The form as its documentation says, without the code under test."""
    (length,) = struct.unpack_from("<I", data)
    assert length % 4 == 0
    head = json.loads(data[4 : 4 + length])
    values = np.frombuffer(data, "<f4", offset=4 + length).reshape(-1, head["samples"])
    names = [channel["name"] for channel in head["channels"]]
    return head, dict(zip(names, values, strict=True))


def test_the_binary_form_is_read_back_in_single_precision(run):
    data = frames.to_binary({"seq": 7, "name": "Schräglage"}, frames.take(run))
    head, values = read_binary(data)
    assert head["seq"] == 7
    assert head["name"] == "Schräglage"
    assert head["channels"] == [
        {"name": "time", "unit": "s"},
        {"name": "chassis.z", "unit": "m"},
        {"name": "chassis.roll", "unit": "rad"},
    ]
    assert_array_equal(values["chassis.z"], run["chassis.z"].astype("f4"))
    assert_array_equal(values["time"], run.time.astype("f4"))


@pytest.mark.parametrize("most", [2, 3, 10, 1000, 2002])
def test_thinning_to_extremes_loses_no_peak(run, most):
    """The least and the greatest value of every channel are still there, in time order."""
    taken = frames.take(run, most=most)
    assert taken.samples <= most
    assert taken.decimation == {"method": "extremes", "from_samples": 2003}
    for name in run.columns:
        assert taken.columns[name].min() == run[name].min()
        assert taken.columns[name].max() == run[name].max()
    assert np.all(np.diff(taken.columns["time"]) >= 0.0)
    assert taken.columns["time"][[0, -1]].tolist() == run.time[[0, -1]].tolist()


def test_an_extreme_stays_within_a_bucket_of_its_time(run):
    """A single peak appears no farther from its time than a bucket is wide."""
    values = np.zeros(2003)
    values[777] = 1.0
    taken = frames.take(Run("peak", run.time, {"chassis.z": values}), most=200)
    seen = taken.columns["time"][np.argmax(taken.columns["chassis.z"])]
    assert abs(seen - run.time[777]) <= 10.0 / 99


def test_thinning_by_stride_keeps_whole_instants(run):
    """Every kept sample is one of the run's, all channels at once."""
    taken = frames.take(run, most=500, decimate="stride")
    assert taken.samples <= 500
    at = np.searchsorted(run.time, taken.columns["time"])
    for name in run.columns:
        assert_array_equal(taken.columns[name], run[name][at])


def test_nothing_is_thinned_that_fits(run):
    taken = frames.take(run, most=2003)
    assert taken.samples == 2003
    assert taken.decimation["method"] == "none"


def test_a_channel_the_run_lacks_is_left_out_and_an_unknown_one_refused(run):
    assert list(frames.take(run, ["tyre.fl.load", "chassis.z"]).columns) == ["time", "chassis.z"]
    with pytest.raises(MeasurementError, match=r"chassis\.z"):
        frames.take(run, ["chasis.z"])


def test_numbers_that_json_lacks_become_null():
    run = Run("gap", np.array([0.0, 1.0]), {"chassis.z": np.array([np.nan, np.inf])})
    reply = json.loads(frames.to_json({"fit_percent": {"chassis.z": -np.inf}}, frames.take(run)))
    assert reply["values"]["chassis.z"] == [None, None]
    assert reply["fit_percent"] == {"chassis.z": None}
    _, values = read_binary(frames.to_binary({}, frames.take(run)))
    assert np.isnan(values["chassis.z"][0])


@pytest.mark.parametrize(
    ("accept", "form"),
    [
        (None, "json"),
        ("*/*", "json"),
        ("text/html, application/json;q=0.9", "json"),
        ("application/vnd.ridetune.frames", "binary"),
        ("TEXT/CSV; charset=utf-8", "csv"),
        ("text/*", "csv"),
    ],
)
def test_the_form_follows_the_accept_header(accept, form):
    assert frames.form_of(accept) == form


def test_a_form_there_is_not_is_refused_with_those_there_are():
    with pytest.raises(NotAcceptable, match="text/csv"):
        frames.form_of("image/png")
