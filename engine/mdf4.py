"""A run as MDF4 (ASAM), by asammdf, which is an extra: large, LGPL, and slow to import."""

import io
from collections.abc import Mapping
from datetime import datetime

from .channels import channel
from .formats.readers import require_package
from .measurement import in_unit
from .run import Run


def run_to_mdf4(
    run: Run, units: Mapping[str, str], facts: Mapping[str, str], date: datetime
) -> bytes:
    """One group of channels, each with its unit, and its meaning and sign as its comment.

    units : by channel, of those that are not to be in SI
    facts : description, vehicle and others, kept in the header;  date : with a time zone
    """
    require_package("MDF4")
    from asammdf import MDF, Signal

    signals = []
    for name in run.columns:
        values, unit = in_unit(run, name, units)
        signals.append(Signal(values, run.time, name=name, unit=unit, comment=_said(name)))
    with MDF(version="4.10") as file:
        file.start_time = date
        file.append(
            signals,
            acq_name=run.name,
            common_timebase=True,
        )
        header = file.header
        header.author, header.project = "ridetune", run.name
        header.subject, header.description = facts["vehicle"], _header(run, facts)
        stream = io.BytesIO()
        file.save(stream)
    return stream.getvalue()


def _said(name: str) -> str:
    info = channel(name)
    return f"{info.label}; {info.sign}"


def _header(run: Run, facts: Mapping[str, str]) -> str:
    """The facts, one a line, and the noise of each channel."""
    lines = [f"{name}: {text}" for name, text in facts.items()]
    lines += [
        f"noise of {name}: {value:g} {channel(name).unit}" for name, value in run.noise.items()
    ]
    return "\n".join(lines)
