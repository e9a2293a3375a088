"""A large MDF 4, written and looked at: how long listing and previewing it take, in what memory.

    python docs/studies/large_files.py [--gigabytes G] [--compressed] [--keep FILE]

Twenty groups of ten channels of float64 at rates from 100 Hz to 2 kHz. Measured are a child's
listing of all columns and the envelopes of three channels in 1500 stretches each, as the page draws
them, and the greatest memory of the child.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

import numpy as np
from asammdf import MDF, Signal
from ridetune.engine.formats.child import ChildTable

GROUPS, CHANNELS = 20, 10
RATES = (100.0, 200.0, 500.0, 1000.0, 2000.0)
STRETCHES = 1500
ADDED_SAMPLES = 1_000_000


def write(path: Path, gigabytes: float, compressed: bool) -> None:
    """Write the file, group after group and each in pieces, so that memory stays small."""
    samples = int(gigabytes * 1e9 / (GROUPS * (CHANNELS + 1) * 8))
    rng = np.random.default_rng(1)
    with MDF(version="4.10") as file:
        for group in range(GROUPS):
            rate = RATES[group % len(RATES)]
            for begin in range(0, samples, ADDED_SAMPLES):
                count = min(ADDED_SAMPLES, samples - begin)
                time_ = (begin + np.arange(count)) / rate
                columns = [
                    np.round(np.sin(time_ * (k + 1)) + rng.normal(0.0, 0.1, count), 3)
                    for k in range(CHANNELS)
                ]
                if begin:
                    file.extend(group, [(one, None) for one in (time_, *columns)])
                    continue
                file.append(
                    [
                        Signal(one, time_, name=f"g{group}.c{k}", unit="mm")
                        for k, one in enumerate(columns)
                    ],
                    acq_name=f"group {group}",
                    common_timebase=True,
                )
        file.save(path, overwrite=True, compression=1 if compressed else 0)


def peak_memory(table: ChildTable) -> float:
    """The greatest resident memory of the child so far, MB."""
    status = Path(f"/proc/{table.pid}/status").read_text()
    (line,) = [line for line in status.splitlines() if line.startswith("VmHWM")]
    return int(line.split()[1]) / 1e3


def processor_time(table: ChildTable) -> float:
    """What the child has spent so far, s; it does not depend on what else the machine does."""
    fields = Path(f"/proc/{table.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Write, measure, print."""
    parser = argparse.ArgumentParser(description="Measure looking into a large MDF 4.")
    parser.add_argument("--gigabytes", type=float, default=1.0)
    parser.add_argument("--compressed", action="store_true")
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = options.keep or Path(folder) / "large.mf4"
        if not path.exists():
            write(path, options.gigabytes, options.compressed)
        print(f"{path.stat().st_size / 1e6:.0f} MB")
        begin = time.perf_counter()
        with ChildTable(path, path.name) as table:
            columns = table.columns
            listed = time.perf_counter() - begin
            chosen = [k for k, column in enumerate(columns) if column.clock is not None]
            for index in (chosen[0], chosen[len(chosen) // 2], chosen[-1]):
                table.envelope(index, STRETCHES)
            seen = time.perf_counter() - begin
            memory, spent = peak_memory(table), processor_time(table)
        print(f"{len(columns)} columns of {columns[0].samples} samples")
        print(f"listed in {listed:.2f} s, with three previews in {seen:.2f} s")
        print(f"{spent:.2f} s of processor time, {memory:.0f} MB at most")


if __name__ == "__main__":
    main()
