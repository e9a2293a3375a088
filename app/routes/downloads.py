"""What is made of a measurement, as a file that a browser saves under a name of its own."""

from pathlib import PurePath
from urllib.parse import quote


def saved_as(recording: str, ending: str) -> dict[str, str]:
    """The header that names a file after its recording: lap-run.csv, of lap.mf4 and run.csv."""
    name = quote(f"{PurePath(recording).stem}-{ending}")
    return {"Content-Disposition": f"attachment; filename*=utf-8''{name}"}
