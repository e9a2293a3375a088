"""Instants as the REST interface shows them: ISO 8601, UTC."""

from datetime import UTC, datetime


def instant(seconds: float | None) -> str | None:
    """Of seconds since the epoch, None for what has not come yet."""
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC).isoformat()
