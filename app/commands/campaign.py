"""`ridetune campaign`: manoeuvres as measurement files of a car that is known."""

import sys
from argparse import Namespace
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from ...engine.campaign import CAMPAIGN, Campaign, Recording, roughened
from ...engine.campaign_run import CampaignProgress, drive
from ...engine.errors import CampaignError
from ...engine.formats.readers import require_package
from ...engine.manoeuvre import Manoeuvre
from ...engine.plant import Plant
from ...engine.recording_files import files_of, files_of_car, names_of
from ...engine.sensor_file import noisy, read_sensors
from ...engine.sensors import SensorSet
from ..work.plants import PLANTS
from .arguments import ArgumentError, band
from .inputs import find_manoeuvre, find_vehicle, read_noise
from .output import make_folder, refuse_input, refuse_to_overwrite, require_writable, whole_file
from .watch import left, watch


def campaign(options: Namespace) -> None:
    """Drive a car through the manoeuvres and write each recording as it is made."""
    planned, date = _plan(options), _date(options.date)
    if options.form == "mf4":
        require_package("MDF4")
    folder = make_folder(options.output)
    require_writable(folder)
    names = names_of(planned.manoeuvres, options.form)
    for name in names:
        refuse_input(folder / name, _inputs(options))
    if not options.force:
        refuse_to_overwrite(folder / name for name in names)
    kept: list[Recording] = []
    try:
        with watch(_line) as progress:
            recordings = drive(planned, processes=options.processes, progress=progress)
            _write(folder, files_of_car(planned))
            for recording in recordings:
                _remove_old(folder, recording, options.form)
                progress.clear()
                _write(folder, files_of(recording, planned, options.form, date))
                kept.append(recording)
    except KeyboardInterrupt:
        _tell_interrupted(planned, kept)
        raise
    if broken := [one for one in kept if one.failure]:
        raise CampaignError(" ".join(_broken(broken)))


def _plan(options: Namespace) -> Campaign:
    """The campaign that the options describe."""
    changed = roughened(
        _manoeuvres(options.manoeuvre or CAMPAIGN),
        options.class_factor,
        None if options.band is None else band(options.band),
        options.road_seed,
    )
    return Campaign.plan(_plant(options), _sensors(options), changed, options.seed)


def _plant(options: Namespace) -> Plant:
    """The car that drives."""
    known = PLANTS[options.plant]
    if options.vehicle is not None and not known.takes_vehicle:
        raise ArgumentError(
            f"--vehicle {options.vehicle}: the {options.plant} car brings its own data; leave out"
            f" --vehicle or --plant {options.plant}."
        )
    return known.make(lambda: find_vehicle(options.vehicle or "paper"))


def _manoeuvres(names: list[str] | tuple[str, ...]) -> dict[str, Manoeuvre]:
    """Manoeuvres by key, that of a file being its name without the end."""
    found: dict[str, Manoeuvre] = {}
    for name in names:
        key = Path(name).stem if name.endswith(".json") else name
        if key in found:
            raise ArgumentError(f"--manoeuvre {name}: {key} is named twice; name it once.")
        found[key] = find_manoeuvre(name)
    return found


def _sensors(options: Namespace) -> SensorSet:
    """The sensors in a file, or the usual ones with a file's noise."""
    if options.sensors is None:
        return noisy(read_noise(options.noise), options.noise or "sensors")
    if options.noise is not None:
        raise ArgumentError("--noise and --sensors both tell the noise; leave out --noise.")
    return read_sensors(Path(options.sensors))


def _date(text: str | None) -> datetime:
    """When the campaign is driven, in UTC unless the text has a zone."""
    if text is None:
        return datetime.now(UTC).replace(microsecond=0)
    try:
        date = datetime.fromisoformat(text)
    except ValueError:
        raise ArgumentError(
            f"--date {text}: this is no date; write it like 2026-05-04 or 2026-05-04T13:30:00."
        ) from None
    return date if date.tzinfo else date.replace(tzinfo=UTC)


def _inputs(options: Namespace) -> list[str | None]:
    return [options.noise, options.sensors, options.vehicle, *(options.manoeuvre or ())]


def _write(folder: Path, files: dict[str, bytes]) -> None:
    for name, data in files.items():
        with whole_file(folder / name) as stream:
            stream.write(data)
        print(f"Wrote {folder / name}.", flush=True)


def _remove_old(folder: Path, recording: Recording, form: str) -> None:
    """Where a whole recording takes the place of a part, or a part that of a whole, of the same
    drive, the other must not stay.
    """
    stem = recording.name if recording.failure else f"{recording.name}.partial"
    for end in (form, "toml"):
        (folder / f"{stem}.{end}").unlink(missing_ok=True)


def _broken(recordings: list[Recording]) -> Iterator[str]:
    for one in recordings:
        kept = "nothing of it was recorded" if one.run is None else "the part before it is kept"
        yield f"{one.name}: {one.failure.rstrip('.')}; {kept}."


def _tell_interrupted(planned: Campaign, kept: list[Recording]) -> None:
    whole = [one.name for one in kept if not one.failure]
    missing = [name for name in planned.manoeuvres if name not in whole]
    print(
        f"Interrupted: {', '.join(whole) or 'nothing'} written whole, {', '.join(missing)} not.",
        file=sys.stderr,
    )


def _line(now: CampaignProgress) -> str:
    failed = f", {now.failed} broken off" if now.failed else ""
    return (
        f"{now.runs} of {now.of} drives{failed}, {now.driven:.1f} of {now.duration:g} s,"
        f" {left(now.driven, now.duration, now.seconds)}"
    )
