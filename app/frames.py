"""Time histories on the wire: compact binary, JSON or CSV, thinned out on request.

Binary form (`application/vnd.ridetune.frames`), little-endian throughout:

    uint32              length of the head in bytes, a multiple of 4
    head                JSON in UTF-8, padded with spaces
    float32[samples]    time, then one array a channel, in the order of head["channels"]

float32 keeps seven digits: 0.1 ms of a time of 1000 s, far below what a chart shows.
"""

import json
import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..engine.channels import channel
from ..engine.run import Run
from .errors import NotAcceptable

Decimate = Literal["extremes", "stride"]
Form = Literal["binary", "json", "csv"]

HISTORIES: dict[str, Form] = {
    "application/vnd.ridetune.frames": "binary",
    "application/json": "json",
}
"""Forms that can be thinned out."""

MEDIA_TYPES: dict[str, Form] = {**HISTORIES, "text/csv": "csv"}

MEDIA_TYPE_OF = {form: name for name, form in MEDIA_TYPES.items()}

SIDES = ("lower", "upper")
"""Ends of a band."""


@dataclass(frozen=True)
class Frames:
    """Some channels of a run as they go out: time first in `columns`."""

    columns: dict[str, NDArray[np.float64]]
    decimation: dict[str, Any]

    @property
    def samples(self) -> int:
        """Number of instants."""
        return len(self.columns["time"])

    @property
    def channels(self) -> list[dict[str, str]]:
        """Name and SI unit of each column, in order."""
        return [{"name": name, "unit": channel(_bare(name)).unit} for name in self.columns]

    def within(self, lower: "Frames", upper: "Frames") -> "Frames":
        """These with the ends of each channel's band, `chassis.z.lower` and `chassis.z.upper`."""
        ends = {
            f"{name}.{side}": values
            for side, frames in zip(SIDES, (lower, upper), strict=True)
            for name, values in frames.columns.items()
            if name != "time"
        }
        return Frames(self.columns | ends, self.decimation)


def _bare(name: str) -> str:
    """The channel whose values, or end of a band, a column has."""
    channel_name, _, side = name.rpartition(".")
    return channel_name if side in SIDES else name


def take(
    run: Run,
    names: Sequence[str] | None = None,
    most: int | None = None,
    decimate: Decimate = "extremes",
) -> Frames:
    """Those of the named channels the run has (all without names), at most `most` samples each.

    A name that no channel has is refused; one that this run lacks is left out, since what a
    simulation gives depends on its mode and model.
    """
    wanted = run.columns if names is None else [name for name in names if channel(name).name in run]
    columns = {"time": run.time} | {name: run[name] for name in wanted}
    count = len(run.time)
    how: dict[str, Any] = {"method": "none", "from_samples": count}
    if most is not None and count > most:
        how["method"] = decimate
        thin = _extremes if decimate == "extremes" else _stride
        columns = thin(columns, count, max(most, 2))
    return Frames(columns, how)


def _stride(
    columns: Mapping[str, NDArray[np.float64]], count: int, most: int
) -> dict[str, NDArray[np.float64]]:
    """Every k-th sample: the same instants for all channels."""
    step = math.ceil(count / most)
    return {name: values[::step] for name, values in columns.items()}


def _extremes(
    columns: Mapping[str, NDArray[np.float64]], count: int, most: int
) -> dict[str, NDArray[np.float64]]:
    """Two samples a bucket: its least and its greatest value, in the order they occur.

    No peak is lost. The two carry the bucket's first and last time, so a peak appears at most a
    bucket's width away from where it was.
    """
    width = math.ceil(count / (most // 2))
    buckets = math.ceil(count / width)
    thinned = {}
    for name, values in columns.items():
        padded = np.pad(values, (0, buckets * width - count), mode="edge").reshape(buckets, width)
        if name == "time":
            pair = np.stack([padded[:, 0], padded[:, -1]], axis=1)
        else:
            ends = np.sort(np.stack([padded.argmin(axis=1), padded.argmax(axis=1)], axis=1), axis=1)
            pair = np.take_along_axis(padded, ends, axis=1)
        thinned[name] = pair.reshape(-1)
    return thinned


def written(head: Mapping[str, Any], frames: Frames, form: Form) -> bytes:
    """In one of the forms of histories: binary, else JSON."""
    return (to_binary if form == "binary" else to_json)(head, frames)


def to_binary(head: Mapping[str, Any], frames: Frames) -> bytes:
    """The binary form; `samples`, `channels` and `decimation` are put into the head."""
    text = _text(_complete(head, frames)).encode()
    text += b" " * (-len(text) % 4)
    arrays = [values.astype("<f4").tobytes() for values in frames.columns.values()]
    return b"".join([struct.pack("<I", len(text)), text, *arrays])


def _text(head: Mapping[str, Any]) -> str:
    """As JSON; numbers that it lacks are rare, and to look for them takes longer than to write."""
    try:
        return json.dumps(head, separators=(",", ":"), allow_nan=False)
    except ValueError:
        return json.dumps(clean(head), separators=(",", ":"))


def to_json(head: Mapping[str, Any], frames: Frames) -> bytes:
    """The head with `values`, numbers that are not finite as null."""
    values = {name: column.tolist() for name, column in frames.columns.items()}
    return _text({**_complete(head, frames), "values": values}).encode()


def _complete(head: Mapping[str, Any], frames: Frames) -> dict[str, Any]:
    return {
        **head,
        "samples": frames.samples,
        "channels": frames.channels,
        "decimation": frames.decimation,
    }


def clean(value: Any) -> Any:
    """The value as JSON can hold it: not-a-number and infinity become null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: clean(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [clean(part) for part in value]
    return value


def form_of(accept: str | None, forms: Mapping[str, Form] = MEDIA_TYPES) -> Form:
    """Which form an Accept header asks for: the first it names that there is, JSON by default."""
    if not accept:
        return "json"
    for choice in accept.split(","):
        name = choice.partition(";")[0].strip().lower()
        if name in forms:
            return forms[name]
        if name in ("*/*", "application/*"):
            return "json"
        if name == "text/*" and "text/csv" in forms:
            return "csv"
    raise NotAcceptable(f"The reply can be had as {', '.join(forms)}; ask for one of them.")
