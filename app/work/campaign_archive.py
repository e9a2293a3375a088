"""The files of a campaign as one archive, and what became of each of its drives."""

import hashlib
import io
import json
from datetime import datetime
from typing import TYPE_CHECKING, Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

from ..jobs.worker import WithFile

if TYPE_CHECKING:
    from ...engine.campaign import Campaign, Recording
    from ...engine.recording_files import Form


def archive_of(recording: "Recording", planned: "Campaign", form: "Form", date: datetime) -> bytes:
    """One drive as it is kept until all have ended: its files, and what became of it as comment."""
    from ...engine.recording_files import files_of

    state = "missing" if recording.run is None else "partial" if recording.failure else "whole"
    stem = f"{recording.name}.partial" if state == "partial" else recording.name
    became = {
        "name": recording.name,
        "state": state,
        "failure": recording.failure,
        "file": None if recording.run is None else f"{stem}.{form}",
    }
    stream = io.BytesIO()
    with ZipFile(stream, "w", ZIP_STORED) as archive:
        for name, data in files_of(recording, planned, form, date).items():
            archive.writestr(name, data)
        archive.comment = json.dumps(became).encode()
    return stream.getvalue()


class CampaignArchive:
    """Made of the drives that have ended."""

    def __init__(self, planned: "Campaign", form: "Form", date: datetime):
        from ...engine.recording_files import files_of_car

        self._planned, self._date = planned, date
        self._became: dict[str, dict[str, Any]] = {}
        self._listed: dict[str, dict[str, Any]] = {}
        self._stream = io.BytesIO()
        self._archive = ZipFile(self._stream, "w")
        self._write(files_of_car(planned))

    def add(self, drive: bytes) -> None:
        """What is left of a drive, see `archive_of`."""
        with ZipFile(io.BytesIO(drive)) as archive:
            became = json.loads(archive.comment)
            self._write({name: archive.read(name) for name in archive.namelist()})
        file = self._listed.get(became["file"])
        self._became[became["name"]] = {**became, "sha256": file and file["sha256"]}

    def closed(self) -> WithFile:
        """All files, their list, and what became of each drive."""
        self._archive.close()
        recordings = [self._became.get(name) or _missing(name) for name in self._planned.manoeuvres]
        found = {"recordings": recordings, "files": list(self._listed.values())}
        return WithFile(found, self._stream.getvalue())

    def _write(self, files: dict[str, bytes]) -> None:
        for name, data in files.items():
            entry = ZipInfo(name, self._date.timetuple()[:6])
            entry.external_attr = 0o644 << 16
            self._archive.writestr(entry, data, ZIP_DEFLATED)
            digest = hashlib.sha256(data).hexdigest()
            self._listed[name] = {"name": name, "bytes": len(data), "sha256": digest}


def _missing(name: str) -> dict[str, Any]:
    """A drive that had not ended."""
    why = "The campaign was cancelled before this drive ended."
    return {"name": name, "state": "missing", "failure": why, "file": None, "sha256": None}
