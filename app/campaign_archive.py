"""The files of a campaign as one archive, and what became of each of its drives."""

import hashlib
import io
from datetime import datetime
from typing import TYPE_CHECKING, Any
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from .worker import WithFile

if TYPE_CHECKING:
    from ..engine.campaign import Campaign, Recording
    from ..engine.recording_files import Form


class CampaignArchive:
    """Written as the drives end, so that little is left to do when they are cut short."""

    def __init__(self, planned: "Campaign", form: "Form", date: datetime):
        from ..engine.recording_files import files_of_car

        self._planned, self._date = planned, date
        self._form: Form = form
        self._ended: dict[str, Recording] = {}
        self._listed: dict[str, dict[str, Any]] = {}
        self._stream = io.BytesIO()
        self._archive = ZipFile(self._stream, "w")
        self._write(files_of_car(planned))

    def add(self, recording: "Recording") -> None:
        """What is left of a drive."""
        from ..engine.recording_files import files_of

        self._ended[recording.name] = recording
        self._write(files_of(recording, self._planned, self._form, self._date))

    def closed(self) -> WithFile:
        """All files, their list, and what became of each drive."""
        self._archive.close()
        recordings = [self._became(name) for name in self._planned.manoeuvres]
        found = {"recordings": recordings, "files": list(self._listed.values())}
        return WithFile(found, self._stream.getvalue())

    def _write(self, files: dict[str, bytes]) -> None:
        for name, data in files.items():
            entry = ZipInfo(name, self._date.timetuple()[:6])
            entry.external_attr = 0o644 << 16
            self._archive.writestr(entry, data, ZIP_DEFLATED)
            digest = hashlib.sha256(data).hexdigest()
            self._listed[name] = {"name": name, "bytes": len(data), "sha256": digest}

    def _became(self, name: str) -> dict[str, Any]:
        """One drive: whole, the part before it broke off, or missing, and why."""
        recording = self._ended.get(name)
        if recording is None:
            why = "The campaign was cancelled before this drive ended."
            return {"name": name, "state": "missing", "failure": why, "file": None, "sha256": None}
        state = "missing" if recording.run is None else "partial" if recording.failure else "whole"
        stem = f"{name}.partial" if state == "partial" else name
        file = self._listed.get(f"{stem}.{self._form}")
        return {
            "name": name,
            "state": state,
            "failure": recording.failure,
            "file": file and file["name"],
            "sha256": file and file["sha256"],
        }
