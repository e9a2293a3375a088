"""A campaign as a background job: what goes to the workers, what they do, what comes back.

Its units are its drives. A worker gets everything by value and gives files back as one archive, so
it needs neither the database nor the data directory and may be another machine.
"""

import re
import time
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from ..errors import InvalidRequest, OverBudget
from ..jobs.kinds import PATIENT, Division, Kind, Progress
from ..jobs.worker import Attempt, CutShort, WithFile
from ..limits import Limits
from ..schemas import CampaignRequest
from ..simulators.simulator import Host
from ..storage.job_row import Job
from .campaign_archive import CampaignArchive, archive_of
from .plants import Known, known_plant

if TYPE_CHECKING:
    from ...engine.campaign import Campaign

KIND = "campaign"

NAME = re.compile(r"[A-Za-z0-9_-]{1,60}")
"""What a recording may be called: it becomes a file's name."""

VALUE_BYTES = 25
"""What a value takes in a recording, at most."""

FRAME_BYTES = 200_000
"""What the files take besides, a recording: notes and the manoeuvre."""


def campaign() -> Kind:
    """The job kind; all that it needs is in its spec."""

    def payload(job: Job) -> dict[str, Any]:
        return job.spec

    drives = Division(names=_drives, unit=drive_one, progress=_progress, slow=_slow, cut_short=True)
    return Kind(task=join_drives, payload=payload, division=drives, priority=PATIENT)


def check_and_fill(
    host: Host, request: CampaignRequest, vehicle: Mapping[str, Any], limits: Limits
) -> dict[str, Any]:
    """In a simulator: everything that the job needs, checked, with what holds untold filled in.

    vehicle : of the session, where the request has none
    """
    from ...engine.campaign import CAMPAIGN, roughened
    from ...engine.formats.readers import require_package
    from ...engine.manoeuvre import manoeuvre_to_json
    from ...engine.vehicle_file import vehicle_to_json

    known = known_plant(request.plant, with_vehicle=request.vehicle is not None)
    if request.noise and request.sensors is not None:
        raise InvalidRequest(
            "noise and sensors both tell the noise; leave out noise.", field="noise"
        )
    if request.format == "mf4":
        require_package("MDF4")
    chosen = _chosen(CAMPAIGN if request.manoeuvres is None else request.manoeuvres)
    changed = roughened(chosen, request.class_factor, request.band, request.road_seed)
    spec = request.model_dump(mode="json", exclude={"key"})
    spec |= {
        "vehicle": vehicle if request.vehicle is None else request.vehicle,
        "manoeuvres": {key: manoeuvre_to_json(one) for key, one in changed.items()},
        "date": datetime.now(UTC).replace(microsecond=0).isoformat(),
    }
    planned = _planned(spec)
    _check_budget(planned, known, limits)
    car = vehicle_to_json(planned.plant.vehicle) if known.takes_vehicle else None
    told = {"drives": list(planned.manoeuvres), "slow": planned.plant.long}
    return {**spec, **told, "vehicle": car, "most_bytes": most_bytes(planned)}


def _chosen(asked: Iterable[str] | Mapping[str, Any]) -> dict[str, Any]:
    """The engine's manoeuvres by key."""
    from ...engine.manoeuvre import manoeuvre_from_json
    from .excitation import known_manoeuvre

    if not isinstance(asked, Mapping):
        listed = list(asked)
        if twice := {key for key in listed if listed.count(key) > 1}:
            raise InvalidRequest(
                f"manoeuvres names {min(twice)[:60]} twice; name it once.", field="manoeuvres"
            )
        return {key: known_manoeuvre(key) for key in listed}
    for key in asked:
        if not NAME.fullmatch(key):
            raise InvalidRequest(
                "manoeuvres has a name that makes no file's name; take 1 to 60 letters, digits,"
                " - and _.",
                field="manoeuvres",
            )
    return {
        key: known_manoeuvre(one) if isinstance(one, str) else manoeuvre_from_json(one, key)
        for key, one in asked.items()
    }


def _planned(spec: Mapping[str, Any]) -> "Campaign":
    """The engine's campaign; raises what a person can mend."""
    from ...engine.campaign import Campaign
    from ...engine.manoeuvre import manoeuvre_from_json
    from ...engine.sensor_file import noisy, sensors_from_json
    from ...engine.vehicle_file import vehicle_from_json

    sensors = (
        noisy(spec["noise"], "noise")
        if spec["sensors"] is None
        else sensors_from_json(spec["sensors"])
    )
    driven = {key: manoeuvre_from_json(one, key) for key, one in spec["manoeuvres"].items()}
    plant = known_plant(spec["plant"]).make(lambda: vehicle_from_json(spec["vehicle"]))
    return Campaign.plan(plant, sensors, driven, spec["seed"])


def _check_budget(planned: "Campaign", known: Known, limits: Limits) -> None:
    """Refuse drives that together are longer than a campaign over REST takes."""
    plant = planned.plant
    most = limits.long_driven_seconds if plant.long else limits.driven_seconds
    if planned.seconds <= most:
        return
    why = f" of the {plant.name} car, {known.effort:g} s a driven second," if plant.long else ""
    raise OverBudget(
        f"The manoeuvres last {planned.seconds:g} s together, a campaign{why} over REST takes at"
        f" most {most:g} s; leave some out or shorten them, or use the command ridetune campaign."
    )


def most_bytes(planned: "Campaign") -> int:
    """How large the files can become together."""
    samples = planned.seconds * planned.sensors.rate_hz + len(planned.manoeuvres)
    values = samples * (1 + len(planned.sensors.sensors))
    return FRAME_BYTES * (1 + len(planned.manoeuvres)) + round(VALUE_BYTES * values)


def _drives(spec: Mapping[str, Any]) -> list[str]:
    """Names of the recordings; a job kept from before they were told is planned anew."""
    return spec["drives"] if "drives" in spec else list(_planned(spec).manoeuvres)


def _slow(spec: Mapping[str, Any]) -> bool:
    """Whether a drive takes longer than a person waits."""
    return spec["slow"] if "slow" in spec else _planned(spec).plant.long


def _progress(spec: Mapping[str, Any], drives: Mapping[str, Progress], at_once: int) -> Progress:
    """How far all drives are; `seconds` are those of the workers together."""
    counted = {
        name: sum(one.get(name, 0) for one in drives.values())
        for name in ("runs", "failed", "driven", "seconds")
    }
    return {
        **counted,
        "of": len(spec["manoeuvres"]),
        "duration": sum(one["duration"] for one in spec["manoeuvres"].values()),
        "at_once": at_once,
    }


def drive_one(payload: Any, attempt: Attempt) -> WithFile:
    """On a worker: one drive, reporting how far it is; its files as an archive."""
    planned, name, began = _planned(payload), payload["unit"], time.perf_counter()

    def reached(driven: float, **ended: int) -> dict[str, Any]:
        return {"driven": driven, "seconds": time.perf_counter() - began, **ended}

    recording = planned.record(
        name, lambda seconds: attempt.report(reached(seconds)), attempt.cancelled
    )
    ended = reached(recording.manoeuvre.duration, runs=1, failed=int(bool(recording.failure)))
    date = datetime.fromisoformat(payload["date"])
    return WithFile(ended, archive_of(recording, planned, payload["format"], date))


def join_drives(payload: Any, attempt: Attempt) -> WithFile:
    """On a worker: the files of all drives as one archive.

    Raises CutShort with those that had ended where the campaign was cancelled before all had.
    """
    planned = _planned(payload)
    archive = CampaignArchive(planned, payload["format"], datetime.fromisoformat(payload["date"]))
    for name in planned.manoeuvres:
        if name in attempt.kept:
            archive.add(attempt.kept[name])
    if len(attempt.kept) < len(planned.manoeuvres):
        raise CutShort(archive.closed())
    return archive.closed()
