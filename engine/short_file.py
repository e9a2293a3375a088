"""A file that somebody names, read no further than its kind may be long."""

from pathlib import Path

from .errors import RideError


def read_short(path: Path, most: int, error: type[RideError]) -> bytes:
    """The bytes of a file, but at most one more than `most`: what parses them refuses so many."""
    try:
        with path.open("rb") as stream:
            return stream.read(most + 1)
    except OSError as cause:
        raise error(f"{path}: cannot be read ({cause.strerror}); check the path.") from cause
