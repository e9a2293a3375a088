"""Campaigns: what is driven, recorded, told and kept apart."""

import io
import json
import tomllib
from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from asammdf import MDF
from numpy.testing import assert_allclose, assert_array_equal
from ridetune.engine.campaign import CAMPAIGN, Campaign, chosen, drive_table_2, roughened
from ridetune.engine.campaign_run import drive
from ridetune.engine.channels import channel
from ridetune.engine.errors import CampaignError, Cancelled, MeasurementError
from ridetune.engine.manoeuvre import manoeuvre_from_json, reference_manoeuvres
from ridetune.engine.measurement import parse_run
from ridetune.engine.plant import ConceptPlant, Driven
from ridetune.engine.recording_files import files_of, files_of_car, names_of
from ridetune.engine.run_notes import parse_notes
from ridetune.engine.sensors import RECORDED, Sensor, SensorSet
from ridetune.engine.simulation.simulate import simulate_road
from ridetune.engine.vehicle_file import reference_vehicles, vehicle_from_json

CAR = reference_vehicles()["paper"]
PLANT = ConceptPlant(CAR)
DATE = datetime(2026, 5, 4, 13, 30, tzinfo=UTC)
WALL = manoeuvre_from_json(
    {
        "name": "Over a wall",
        "kind": "road",
        "duration": 4,
        "initial_speed": 20,
        "road": {"kind": "bump", "begin": 30, "length": 1.0, "height": 0.5},
    }
)
SENSORS = SensorSet(
    sensors={
        "chassis.z": Sensor(noise=5e-4, bias=0.01, gain=1.02, delay=0.02),
        "wheel.fl.z": Sensor(unit="mm", rate_hz=100.0, cutoff_hz=40.0),
        "point.boot.a_z": Sensor(),
    },
    points={"point.boot": (-1.5, 0.0, 0.2)},
)


def short(*keys):
    return {key: reference_manoeuvres()[key].lasting(1.5) for key in keys}


def recordings(campaign, **how):
    return {one.name: one for one in drive(campaign, **how)}


def test_the_usual_sensors_record_the_simulation_itself():
    """Oracle: the simulation at the recording's instants."""
    [found] = drive(Campaign.plan(PLANT, SensorSet(), short("bump")))
    run = simulate_road(CAR, short("bump")["bump"]).run
    assert (found.name, found.failure) == ("manoeuvre_bump", "")
    assert found.run.columns == list(RECORDED)
    for name in RECORDED:
        assert_allclose(found.run[name], run[name], rtol=1e-9, atol=1e-12)


def test_a_point_of_one_s_own_has_an_accelerometer():
    """Oracle: the simulation with that point."""
    [found] = drive(Campaign.plan(PLANT, SENSORS, short("bump")))
    run = simulate_road(CAR, short("bump")["bump"], points=SENSORS.points).run
    assert_allclose(found.run["point.boot.a_z"], run["point.boot.a_z"], rtol=1e-9, atol=1e-9)


def test_noise_does_not_depend_on_what_else_is_driven():
    sensors = SensorSet(sensors={"chassis.z": Sensor(noise=1e-3)})
    alone = recordings(Campaign.plan(PLANT, sensors, short("bump"), seed=4))
    among = recordings(Campaign.plan(PLANT, sensors, short("1", "bump"), seed=4))
    assert_array_equal(
        alone["manoeuvre_bump"].run["chassis.z"], among["manoeuvre_bump"].run["chassis.z"]
    )


def test_processes_record_what_one_process_does():
    """Oracle: the campaign in this process; what broke off is the same, too."""
    campaign = Campaign.plan(PLANT, SENSORS, {**short("1", "bump"), "wall": WALL})
    told = []
    here, beside = recordings(campaign), recordings(campaign, processes=2, progress=told.append)
    assert here.keys() == beside.keys()
    for name, one in here.items():
        assert one.failure == beside[name].failure
        for channel_name in one.run.columns:
            assert_array_equal(one.run[channel_name], beside[name].run[channel_name])
    assert (told[-1].runs, told[-1].of, told[-1].failed) == (3, 3, 1)
    assert told[-1].driven == told[-1].duration == campaign.seconds


def test_a_drive_that_diverges_keeps_its_beginning_and_leaves_the_others_alone():
    """Oracle: the same drive cut before the wall."""
    ended = recordings(Campaign.plan(PLANT, SensorSet(), {"wall": WALL, **short("bump")}))
    broken, whole = ended["manoeuvre_wall"], ended["manoeuvre_bump"]
    assert "diverged at t = 1.4" in broken.failure
    assert whole.failure == ""
    assert 1.35 < broken.run.duration < 1.5
    before = simulate_road(CAR, WALL.lasting(1.3)).run
    assert_allclose(broken.run["chassis.z"][: before.time.size], before["chassis.z"], atol=1e-9)


def test_a_drive_that_ends_before_a_second_sample_says_why_it_ended():
    """Oracle: what the plant says; five samples a second are one in 0.1 s."""

    class Stuck(ConceptPlant):
        def drive(self, manoeuvre, **how):
            return Driven(super().drive(manoeuvre.lasting(0.1), **how).run, "It broke off.")

    campaign = Campaign.plan(Stuck(CAR), SensorSet(5.0), short("bump"))
    [found] = drive(campaign)
    assert (found.run, found.failure) == (None, "It broke off.")


def test_a_cancelled_campaign_keeps_what_has_ended():
    ended, campaign = [], Campaign.plan(PLANT, SensorSet(), short("1", "2", "bump"))
    recording = drive(campaign, cancelled=lambda: bool(ended))
    ended.append(next(recording).name)
    with pytest.raises(Cancelled, match="cancelled after 1 of 3 drives"):
        next(recording)
    assert ended == ["manoeuvre_1"]


def test_cancelled_processes_end():
    campaign = Campaign.plan(PLANT, SensorSet(), chosen(CAMPAIGN))
    with pytest.raises(Cancelled):
        list(drive(campaign, processes=2, cancelled=lambda: True))


@pytest.mark.parametrize(
    ("manoeuvres", "sentence"),
    [({}, "has no manoeuvre"), (short("heave"), "heave moves the posts of a rig")],
)
def test_what_cannot_be_driven_is_refused_at_once(manoeuvres, sentence):
    with pytest.raises(CampaignError, match=sentence):
        Campaign.plan(PLANT, SensorSet(), manoeuvres)


def test_sensors_and_processes_are_checked_before_the_first_drive():
    with pytest.raises(MeasurementError, match="sensors: rate_hz is 500, but the concept car"):
        Campaign.plan(PLANT, SensorSet(500.0), short("bump"))
    with pytest.raises(CampaignError, match="0 processes are asked for"):
        drive(Campaign.plan(PLANT, SensorSet(), short("bump")), processes=0)


def test_road_options_change_random_roads_alone_and_are_refused_where_there_is_none():
    changed = roughened(chosen(CAMPAIGN), 0.5, (0.03, 2.83), 7)
    assert changed["bump"] == reference_manoeuvres()["bump"]
    assert (changed["2"].road.class_factor, changed["2"].road.band) == (0.5, (0.03, 2.83))
    assert {one.seed for key, one in changed.items() if key != "bump"} == {7}
    assert roughened(chosen(["bump"])) == chosen(["bump"])
    with pytest.raises(CampaignError, match="None of the manoeuvres has a random road"):
        roughened(chosen(["bump"]), seed=3)


def test_the_paper_s_campaign_names_a_car_that_does_not_come_through():
    limp = CAR.with_values({"rear.suspension.stiffness": 200.0, "rear.suspension.damping": 20.0})
    with pytest.raises(CampaignError, match="manoeuvre_1: "):
        drive_table_2(limp)


def test_notes_state_noise_rates_and_filters_and_the_truth_lies_apart():
    campaign = Campaign.plan(PLANT, SENSORS, short("bump"), seed=5)
    [recording] = drive(campaign)
    files = files_of(recording, campaign, "csv", DATE)
    assert sorted(files) == [
        "manoeuvre_bump.csv",
        "manoeuvre_bump.manoeuvre.json",
        "manoeuvre_bump.toml",
    ]
    assert set(files) < set(names_of(campaign.manoeuvres, "csv"))
    told = tomllib.loads(files["manoeuvre_bump.toml"].decode())
    assert parse_notes(files["manoeuvre_bump.toml"], "n").noise == {"chassis.z": 5e-4}
    assert told["date"] == DATE
    assert told["rate_hz"] == 200.0
    stated = {"rate_hz": 100.0, "cutoff_hz": 40.0, "filter_order": 4}
    assert told["sensors"] == {"wheel.fl.z": stated}
    driven = json.loads(files["manoeuvre_bump.manoeuvre.json"])
    assert manoeuvre_from_json(driven) == short("bump")["bump"]
    car = files_of_car(campaign)
    assert vehicle_from_json(json.loads(car["vehicle.json"])) == CAR
    truth = json.loads(car["truth.json"])
    assert (truth["seed"], truth["plant"]) == (5, "concept")
    assert truth["sensors"]["chassis.z"] == {
        **{"noise": 5e-4, "bias": 0.01, "gain": 1.02, "delay": 0.02},
        **{"rate_hz": None, "cutoff_hz": None, "unit": None, "resolution": 0.0},
    }
    for hidden in (b"0.01", b"1.02", b"bias", b"delay"):
        assert hidden not in files["manoeuvre_bump.toml"]


def test_notes_are_toml_whatever_the_car_is_called():
    """Oracle: the standard library's reader, which takes no escaped half of a character."""
    name = 'é "\\" \U0001f697 \x7f\n'
    campaign = Campaign.plan(ConceptPlant(replace(CAR, name=name)), SensorSet(), short("bump"))
    [recording] = drive(campaign)
    files = files_of(recording, campaign, "csv", DATE)
    assert tomllib.loads(files["manoeuvre_bump.toml"].decode())["vehicle"] == name


def test_a_part_is_named_so_and_its_notes_say_why():
    campaign = Campaign.plan(PLANT, SensorSet(), {"wall": WALL})
    [recording] = drive(campaign)
    files = files_of(recording, campaign, "csv", DATE)
    assert "manoeuvre_wall.partial.csv" in files
    assert parse_run(files["manoeuvre_wall.partial.csv"], "r").duration < 1.5
    told = tomllib.loads(files["manoeuvre_wall.partial.toml"].decode())
    assert told["partial"] == recording.failure
    nothing = files_of(replace(recording, run=None), campaign, "csv", DATE)
    assert list(nothing) == ["manoeuvre_wall.manoeuvre.json"]


def test_a_sensor_s_unit_and_resolution_are_those_of_the_file():
    """Oracle: degrees in steps of 0.01; the recording itself is in radians."""
    sensors = SensorSet(sensors={"chassis.pitch": Sensor(unit="deg", resolution=0.01)})
    campaign = Campaign.plan(PLANT, sensors, short("bump"))
    [recording] = drive(campaign)
    text = files_of(recording, campaign, "csv", DATE)["manoeuvre_bump.csv"].decode()
    head, *rows = text.splitlines()
    assert head == "time [s],chassis.pitch [deg]"
    written = [row.split(",")[1] for row in rows]
    assert max(len(value.lstrip("-")) for value in written) == len("0.12")
    assert_allclose(
        np.radians([float(value) for value in written]), recording.run["chassis.pitch"], atol=1e-12
    )


def test_mdf4_holds_the_recording_with_units_meaning_and_date():
    """Oracle: asammdf's own reader."""
    campaign = Campaign.plan(PLANT, SENSORS, short("bump"), seed=5)
    [recording] = drive(campaign)
    data = files_of(recording, campaign, "mf4", DATE)["manoeuvre_bump.mf4"]
    with MDF(io.BytesIO(data)) as file:
        assert file.start_time == DATE
        assert file.header.subject == CAR.name
        assert "manoeuvre: manoeuvre_bump.manoeuvre.json" in file.header.description
        assert "noise of chassis.z: 0.0005 m" in file.header.description
        names = Counter(name for name in file.channels_db if name != "time")
        assert set(names) == set(SENSORS.sensors)
        for name in SENSORS.sensors:
            signal = file.get(name)
            assert signal.unit == SENSORS.units().get(name, channel(name).unit)
            assert channel(name).label in signal.comment
            in_si = signal.samples * SENSORS.sensors[name].si_factor(name)
            assert_allclose(in_si, recording.run[name], rtol=1e-15)
            assert_array_equal(signal.timestamps, recording.run.time)
