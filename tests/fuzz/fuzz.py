"""Spoilt and hostile files of every kind: a table, or one sentence, and nothing else.

    python tests/fuzz/fuzz.py [--minutes M] [--kind KIND ...] [--seed N] [--keep FOLDER]

Of a kind, one file in four is sound and hard to bear (`hostile`), one in eight is cut short or has
its line ends converted, the rest has one to four mutations (`mutations`). One child reads many
files, one after the other, under the limits of a real one; where it dies, the next file starts
another, and a sound one is read once more, since those before it may have spoilt the memory. What
it answers goes the ways of a recording: every column, envelopes, the survey and guess of `ridetune
channels`, the run of a mapping and of titles, or a road. Texts that people write (vehicle,
manoeuvre, mapping, sensors, notes) are read in this process (`texts`).

A finding, which keeps the file and ends with status 1: another error than ours; a sentence that is
not one line, does not begin with the file's name, or shows what only a programmer understands; a
table without numbers; numbers other than written where a file is sound or cut short; more than
SLOWEST seconds of processor time. A crash, a hang and spent memory end the child, which is what it
is for: they are counted by the parent's sentence.
"""

import argparse
import gc
import os
import random
import sys
import tempfile
import time
import warnings
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from ridetune.engine.clocks import even_time
from ridetune.engine.errors import MeasurementError
from ridetune.engine.formats.child import Bounds, ChildTable
from ridetune.engine.formats.kinds import ERG_ZIP
from ridetune.engine.formats.readers import HALF_TRACK, ROAD
from ridetune.engine.formats.table import Column
from ridetune.engine.mapping.mapping import ChannelMapping, MappedColumn
from ridetune.engine.mapping.reading import mapped_run
from ridetune.engine.mapping.signs import check_signs
from ridetune.engine.mapping.survey import survey
from ridetune.engine.measurement import named_run
from ridetune.engine.roads.road_file import crg_road

from tests import files_of_kinds
from tests.fuzz import texts
from tests.fuzz.findings import SLOWEST, Tally, check_text, refused, sentence, shape
from tests.fuzz.hostile import HEIGHT, HOSTILE
from tests.fuzz.mutations import spoilt

BOUNDS = Bounds(cpu=60, wall=30.0)
"""Processor time for the many files that one process reads; time for an answer."""

MOST_OPEN = 24
"""Files that a child may hold open before another takes its place: some readers close none."""

ENDED = "sound, but its reader ended"

TRACKS = {"left": HALF_TRACK, "right": -HALF_TRACK}


class Worker(ChildTable):
    """A child that goes on to the next file."""

    def __init__(self, path: Path, kind: str):
        options = TRACKS if kind == ROAD else None
        super().__init__(path, path.name, kind=kind, options=options, bounds=BOUNDS)

    def reopen(self, path: Path, kind: str) -> None:
        """Read another file in the same process, which may read its own folder; memory anew."""
        self.source, inside = path.name, Path(self._folder)
        for name in (path.name, f"{path.name}.info"):
            # Another file, not another content: HDF5 keeps what it has open.
            (inside / name).unlink(missing_ok=True)
            with suppress(FileNotFoundError):
                (inside / name).write_bytes(path.with_name(name).read_bytes())
        with suppress(OSError):
            Path(f"/proc/{self.pid}/clear_refs").write_text("5")
        self._open(inside / path.name, kind, TRACKS if kind == ROAD else {})

    @property
    def cpu(self) -> float:
        """Processor time, s; 0 of one that has ended."""
        with suppress(OSError, ValueError, IndexError):
            fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
            return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        return 0.0

    @property
    def memory(self) -> float:
        """Most memory since the file was opened, MB; 0 of one that has ended."""
        with suppress(OSError, IndexError):
            status = Path(f"/proc/{self.pid}/status").read_text()
            return int(status.partition("VmHWM:")[2].split()[0]) / 1024.0
        return 0.0

    @property
    def ended(self) -> bool:
        """Whether it runs no more."""
        return self._process.poll() is not None

    @property
    def fresh(self) -> bool:
        """Whether it runs and has time and files to go on."""
        if self.ended or self.cpu > 0.5 * BOUNDS.cpu:
            return False
        return len(os.listdir(f"/proc/{self.pid}/fd")) < MOST_OPEN


def fresh_worker(sound: Path, kind: str) -> Worker:
    """A child that has read a sound file twice, so that it will not refuse all that comes."""
    worker = Worker(sound, kind)
    worker.reopen(sound, kind)
    assert worker.columns
    return worker


def read(path: Path, kind: str, worker: Worker, expected: Mapping[str, np.ndarray] | None) -> str:
    """What came of a file, in a word or a sentence; AssertionError for what must not come.

    expected : what the columns of these names must hold, as far as they have samples
    """
    sound = path.stem == "hostile"
    try:
        worker.reopen(path, kind)
        columns = worker.columns
    except MeasurementError as error:
        if sound:
            raise AssertionError(f"sound, but refused: {error}") from error
        return shape(sentence(error, path.name), path.name)
    assert columns
    assert all(column.samples > 0 for column in columns)
    for said in worker.warnings:
        check_text(said)
    index, table, compared = random.Random(len(columns)).randrange(len(columns)), "table", set()
    known = {k for k, column in enumerate(columns) if column.name in (expected or {})}
    for k in {*range(min(20, len(columns))), index, *known}:
        # In text, what is no number spoils its own column, and is found when that is read.
        with refused(path.name, never=sound and (k in known or worker.kind != "CSV")):
            values = worker.values(k)
            assert len(values) == columns[k].samples
            if expected and k in known:
                _compare(columns[k].name, values, expected[columns[k].name], not sound)
                compared.add(columns[k].name)
                if sound and kind != ROAD:
                    _compare("the time", _time(worker, columns[k]), files_of_kinds.TIME, False)
    if expected and sound:
        assert compared == set(expected), f"only {sorted(compared)} are there"
    with refused(path.name):
        worker.envelope(index, 10)
    with refused(path.name):
        assert np.isfinite(worker.in_si([(index, 1e-3, 1.0)])).all()
    if kind == ROAD:
        with refused(path.name):
            crg_road(worker)
        assert not (sound and worker.ended), ENDED
        return table
    with refused(path.name):
        found = survey(worker)
        found = found.with_templates({"template": found.guess.mapping})
        list(map(check_text, found.warnings))
        check_signs(mapped_run(worker, found.guess.mapping, {}, ""))
    with refused(path.name):
        one = MappedColumn(columns[index].name, "chassis.z", "mm", columns[index].group, sign=-1)
        mapped_run(worker, ChannelMapping((one,), longest_gap=1.0), {}, "")
    with refused(path.name):
        named_run(worker, {}, "")
    assert not (sound and worker.ended), ENDED
    return table


def _time(worker: Worker, column: Column) -> np.ndarray | None:
    if column.clock is not None:
        return worker.values(column.clock)
    return None if column.step is None else even_time(column)


def _compare(name: str, values: np.ndarray | None, expected: np.ndarray, cut: bool) -> None:
    """Whether numbers are those expected, of a file cut short the first of them."""
    assert values is not None, f"{name} is not told"
    wanted = expected[: len(values)]
    assert len(wanted) == len(values), f"{name} has {len(values)} samples"
    assert cut or len(values) == len(expected), f"{name} has only {len(values)} samples"
    off = np.abs(values - wanted)
    # Of a text cut short, the last number may have lost digits.
    assert np.all(off[: len(off) - cut] < 1e-3), f"{name} is off"


class Files:
    """The files of one kind, one after the other, in a folder."""

    def __init__(self, kind: str, seed: int, folder: Path):
        self.kind, self._folder = kind, folder
        self.chance = random.Random(f"{kind} {seed}")
        self._seeds: dict[str, bytes] = {}
        for name, (write, of_kind, _) in files_of_kinds.WRITERS.items():
            if of_kind == kind:
                write(folder / name)
                self._seeds[name] = (folder / name).read_bytes()
        first = next(iter(self._seeds), "r.crg")
        suffix = ".zip" if kind == "CarMaker ERG" else Path(first).suffix
        for k in range(8):
            HOSTILE[kind](self._new(f"h{k}{suffix}"), random.Random(k))
            self._seeds[f"h{k}{suffix}"] = (folder / f"h{k}{suffix}").read_bytes()
        if kind == ROAD:
            self._seeds["curved.crg"] = CURVED.read_bytes()
        self._info = b""
        if (info := folder / f"{first}.info").exists():
            self._info = info.read_bytes()
        self.sound = self._held(
            f"sound-{next(iter(self._seeds))}", next(iter(self._seeds.values()))
        )

    def _new(self, name: str) -> Path:
        """Where a file may be written by those who write no file twice."""
        (self._folder / name).unlink(missing_ok=True)
        return self._folder / name

    def _held(self, name: str, data: bytes, info: bytes | None = None) -> Path:
        self._new(name).write_bytes(data)
        if name.endswith(".erg"):
            self._new(f"{name}.info").write_bytes(self._info if info is None else info)
        return self._folder / name

    def next(self) -> tuple[Path, str, Mapping[str, np.ndarray] | None]:
        """A file, its kind, and what its channels must hold where that is known."""
        chance, sort, known = self.chance, self.chance.random(), EXPECTED[self.kind == ROAD]
        if sort < 0.25:
            path = self._new(f"hostile{Path(next(iter(self._seeds))).suffix}")
            if self.kind == "CarMaker ERG":
                path = self._new("hostile.zip")
            HOSTILE[self.kind](path, chance)
            return path, ERG_ZIP if path.suffix == ".zip" else self.kind, known
        name, data = chance.choice(list(self._seeds.items()))
        other, info = chance.choice(list(self._seeds.values())), None
        if sort < 0.38:
            wrong, known = bytearray(data), None if name == "curved.crg" else known
            if sort < 0.32:
                del wrong[chance.randrange(len(wrong)) :]
            else:
                old, new = chance.choice([(b"\n", b"\r\n"), (b"\r\n", b"\n")])
                wrong = wrong.replace(old, new)
            data = bytes(wrong)
        else:
            known = None
            if name.endswith(".erg") and chance.random() < 0.5:
                info = spoilt(self._info, other, chance)
            else:
                data = spoilt(data, other, chance)
        return self._held(name, data, info), ERG_ZIP if name.endswith(".zip") else self.kind, known


CURVED = Path(__file__).parents[1] / "data/opencrg/handmade_curved_banked_sloped.crg"

EXPECTED = (
    {name: values for name, (values, _) in files_of_kinds.CHANNELS.items()},
    {"left": HEIGHT, "right": HEIGHT, "x": 0.1 * np.arange(len(HEIGHT))},
)
"""By column, of a recording and of a road."""


def outcomes(kind: str, seconds: float, seed: int, keep: Path, fewest: int = 10) -> Tally:
    """What comes of files of one kind, for some seconds.

    fewest : files that are read at least, however slow the machine is
    """
    tally, begun = Tally(), time.monotonic()
    with tempfile.TemporaryDirectory() as made, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        gc.freeze()  # pyuff's files take a collection each
        files = Files(kind, seed, Path(made))
        worker, many = fresh_worker(files.sound, kind), 0
        try:
            while many < fewest or time.monotonic() - begun < seconds:
                many += 1
                path, told, expected = files.next()
                if not worker.fresh:
                    worker.close()
                    worker = fresh_worker(files.sound, kind)
                if kind != ROAD and files.chance.random() < 0.5:
                    told = ""  # found by the content, as of every upload
                cpu, here = worker.cpu, time.process_time()
                try:
                    warnings.simplefilter("error")
                    try:
                        outcome = read(path, told, worker, expected)
                    except AssertionError:
                        if not (path.stem == "hostile" and worker.ended):
                            raise
                        # A file before it may have spoilt the memory; a recording is the first.
                        worker.close()
                        worker = fresh_worker(files.sound, kind)
                        cpu = worker.cpu
                        outcome = read(path, told, worker, expected)
                    spent = max(worker.cpu - cpu, time.process_time() - here)
                    tally.cpu = max(tally.cpu, spent)
                    assert spent < SLOWEST, "slow"
                except Exception as error:
                    beside = path.with_name(f"{path.name}.info")
                    held = [path, beside] if beside.exists() else [path]
                    outcome = tally.found(error, {one.name: one.read_bytes() for one in held}, keep)
                finally:
                    warnings.simplefilter("ignore")
                tally.memory = max(tally.memory, worker.memory)
                tally.outcomes[outcome] += 1
        finally:
            worker.close()
    tally.seconds = time.monotonic() - begun
    return tally


KINDS = (*HOSTILE, *texts.KINDS)


def main() -> int:
    """Fuzz the kinds that the arguments name."""
    parser = argparse.ArgumentParser(description="Read spoilt and hostile files of every kind.")
    parser.add_argument("--minutes", type=float, default=1.0, help="for each kind")
    parser.add_argument("--kind", nargs="*", default=KINDS, choices=KINDS, metavar="KIND")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--keep", type=Path, default=Path("fuzzed"))
    options = parser.parse_args()
    print(f"seed {options.seed}")
    found = 0
    for kind in options.kind:
        seconds = 60.0 * options.minutes
        if kind in texts.KINDS:
            tally = texts.outcomes(kind, seconds, options.seed, options.keep)
        else:
            tally = outcomes(kind, seconds, options.seed, options.keep)
        print(tally.told(kind), flush=True)
        found += len(tally.findings)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
