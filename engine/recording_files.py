"""The files of a campaign: recordings with notes and manoeuvres, the car, and the truth apart.

NAME.csv or NAME.mf4       the recording; NAME.partial.csv where the car did not come through
NAME.toml                  what is known of it; likewise NAME.partial.toml
NAME.manoeuvre.json        what was driven
vehicle.json               what is known of the car
truth.json                 what nobody but a test may know
"""

import json
from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any, Literal

from .campaign import Campaign, Recording
from .manoeuvre import manoeuvre_to_json
from .mdf4 import run_to_mdf4
from .measurement import run_to_csv
from .sensors import ANTIALIAS_ORDER, SensorSet
from .toml_text import toml_table, toml_value
from .vehicle_file import vehicle_to_json

Form = Literal["csv", "mf4"]


def files_of_car(campaign: Campaign) -> dict[str, bytes]:
    """What is known of the car, and the truth."""
    known = vehicle_to_json(campaign.plant.vehicle)
    return {"vehicle.json": _json(known), "truth.json": _json(campaign.truth())}


def files_of(
    recording: Recording, campaign: Campaign, form: Form, date: datetime
) -> dict[str, bytes]:
    """The files of one recording by name; one that never began has its manoeuvre alone.

    date : when it was driven, with a time zone
    """
    files = {f"{recording.name}.manoeuvre.json": _json(manoeuvre_to_json(recording.manoeuvre))}
    if recording.run is not None:
        stem = f"{recording.name}{'.partial' if recording.failure else ''}"
        units = campaign.sensors.units()
        files[f"{stem}.{form}"] = (
            run_to_csv(recording.run, units).encode()
            if form == "csv"
            else run_to_mdf4(recording.run, units, _facts(recording, campaign), date)
        )
        files[f"{stem}.toml"] = notes(recording, campaign, date).encode()
    return files


def names_of(names: Iterable[str], form: Form) -> list[str]:
    """Every file that a campaign with recordings of these names may write."""
    ends = (form, "toml", f"partial.{form}", "partial.toml", "manoeuvre.json")
    return ["vehicle.json", "truth.json", *(f"{name}.{end}" for name in names for end in ends)]


def notes(recording: Recording, campaign: Campaign, date: datetime) -> str:
    """What `read_run` finds beside a recording, and what a person wants to know, as TOML."""
    assert recording.run is not None
    facts = {name: toml_value(text) for name, text in _facts(recording, campaign).items()}
    facts |= {"date": date.isoformat(), "rate_hz": repr(campaign.sensors.rate_hz)}
    lines = [f"{name} = {value}" for name, value in facts.items()]
    lines += toml_table("[noise]", recording.run.noise)
    for name, stated in _stated(campaign.sensors).items():
        lines += toml_table(f"[sensors.{toml_value(name)}]", stated)
    return "\n".join([*lines, ""])


def _facts(recording: Recording, campaign: Campaign) -> dict[str, str]:
    """What a recording says of itself."""
    assert recording.run is not None
    facts = {
        "description": recording.run.description,
        "vehicle": campaign.plant.vehicle.name,
        "manoeuvre": f"{recording.name}.manoeuvre.json",
        "plant": campaign.plant.name,
    }
    return facts | ({"partial": recording.failure} if recording.failure else {})


def _stated(sensors: SensorSet) -> Mapping[str, Mapping[str, float]]:
    """Rates and filters of the sensors that have their own."""
    found = {}
    for name, sensor in sensors.sensors.items():
        stated = {}
        if sensor.rate_hz is not None:
            stated["rate_hz"] = sensor.rate_hz
        if sensor.cutoff_hz is not None:
            stated |= {"cutoff_hz": sensor.cutoff_hz, "filter_order": ANTIALIAS_ORDER}
        if stated:
            found[name] = stated
    return found


def _json(data: Any) -> bytes:
    return (json.dumps(data, indent=2) + "\n").encode()
