"""Spoilt files of every kind, read within a child: a table, or one sentence, and nothing else.

    python tests/fuzz/fuzz.py [--minutes M] [--kind KIND ...] [--seed N] [--keep FOLDER]

One child reads many spoilt files, one after the other, under the limits of a real one; where it
dies, the next file starts another. Status 1 and the file kept: an answer that is neither, text of a
traceback, an error of the parent. A crash, a hang and spent memory end the child, which is what it
is for: they are counted by the parent's sentence.
"""

import argparse
import os
import random
import struct
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from ridetune.engine.errors import MeasurementError
from ridetune.engine.formats.child import Bounds, ChildTable

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests import files_of_kinds

BOUNDS = Bounds(cpu=40, wall=10.0)
"""Processor time for the many files that one process reads; time for an answer."""

FEWEST = 10
"""Files of a kind that are read at least, however slow the machine is."""

EXTREMES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 2**63 - 1, 2**64 - 1)


class Worker(ChildTable):
    """A child that goes on to the next file."""

    def __init__(self, folder: Path, kind: str):
        sound = next(name for name, (_, one, _) in files_of_kinds.WRITERS.items() if one == kind)
        files_of_kinds.WRITERS[sound][0](folder / f"sound-{sound}")
        super().__init__(folder / f"sound-{sound}", "sound", kind=kind, bounds=BOUNDS)

    def reopen(self, path: Path, kind: str) -> None:
        """Read another file in the same process."""
        self.source = path.name
        self._open(path, kind, {})

    def spent(self) -> bool:
        """Whether most of its processor time is gone: many files share it."""
        with suppress(OSError, ValueError, IndexError):
            fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
            ticks = int(fields[11]) + int(fields[12])
            return ticks / os.sysconf("SC_CLK_TCK") > 0.4 * BOUNDS.cpu
        return True

    @property
    def alive(self) -> bool:
        """Whether the process still runs."""
        return self._process.poll() is None


def spoilt(data: bytes, other: bytes, chance: random.Random) -> bytes:
    """The bytes of a file with one to four mutations."""
    held = bytearray(data)
    for _ in range(chance.randint(1, 4)):
        chance.choice(MUTATIONS)(held, other, chance)
    return bytes(held)


def flip(held: bytearray, _: bytes, chance: random.Random) -> None:
    """Some bits, rather in the head."""
    for _ in range(chance.randint(1, 8)):
        if held:
            held[place(held, chance)] ^= 1 << chance.randrange(8)


def cut(held: bytearray, _: bytes, chance: random.Random) -> None:
    """The end."""
    del held[chance.randrange(len(held) + 1) :]


def length(held: bytearray, _: bytes, chance: random.Random) -> None:
    """A number of four or eight bytes set to an extreme, as a length or an offset may be."""
    size, order = chance.choice([2, 4, 8]), chance.choice("<>")
    value = chance.choice(EXTREMES) & (256**size - 1)
    at = place(held, chance) // 4 * 4
    held[at : at + size] = struct.pack(order + {2: "H", 4: "I", 8: "Q"}[size], value)


def repeat(held: bytearray, _: bytes, chance: random.Random) -> None:
    """A piece doubled."""
    at, size = place(held, chance), chance.randint(1, 64)
    held[at:at] = held[at : at + size]


def remove(held: bytearray, _: bytes, chance: random.Random) -> None:
    """A piece taken out."""
    at = place(held, chance)
    del held[at : at + chance.randint(1, 64)]


def splice(held: bytearray, other: bytes, chance: random.Random) -> None:
    """A piece of another file of the kind."""
    if other:
        at, of, size = place(held, chance), chance.randrange(len(other)), chance.randint(1, 512)
        held[at : at + size] = other[of : of + size]


MUTATIONS: list[Callable[[bytearray, bytes, random.Random], None]] = [
    *(flip, cut, length, length, repeat, remove, splice)
]


def place(held: bytearray, chance: random.Random) -> int:
    """A place in a file, every other time in its first kilobyte."""
    most = max(len(held), 1)
    return chance.randrange(min(most, 1024) if chance.random() < 0.5 else most)


def read(path: Path, kind: str, worker: Worker) -> str:
    """What came of a file, in a word."""
    try:
        worker.reopen(path, kind)
        for index, column in enumerate(worker.columns[:20]):
            assert len(worker.values(index)) == column.samples
    except MeasurementError as error:
        said = str(error)
        assert said.startswith(path.name), said
        assert said.endswith("."), said
        assert "Traceback" not in said, said
        return "sentence" if worker.alive else said[len(path.name) + 2 :]
    return "table"


def outcomes(kind: str, seconds: float, seed: int, keep: Path) -> Iterator[str]:
    """What comes of spoilt files of one kind, for some seconds."""
    chance, count = random.Random(f"{kind} {seed}"), 0
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        seeds = []
        for name, (write, of_kind, _) in files_of_kinds.WRITERS.items():
            if of_kind == kind:
                write(folder / name)
                seeds.append((name, (folder / name).read_bytes()))
        worker = Worker(folder, kind)
        until = time.monotonic() + seconds
        try:
            while count < FEWEST or time.monotonic() < until:
                count += 1
                name, data = chance.choice(seeds)
                wrong = spoilt(data, chance.choice(seeds)[1], chance)
                # Another file, not another content: HDF5 keeps what it has open.
                (folder / name).unlink()
                (folder / name).write_bytes(wrong)
                told = "CarMaker ERG in a zip archive" if name.endswith(".zip") else kind
                if not worker.alive or worker.spent():
                    worker.close()
                    worker = Worker(folder, kind)
                try:
                    outcome = read(folder / name, told, worker)
                except BaseException:
                    keep.mkdir(parents=True, exist_ok=True)
                    kept = keep / f"{abs(hash(wrong)):x}-{name}"
                    kept.write_bytes(wrong)
                    print(f"{kind}: kept {kept}", file=sys.stderr)
                    raise
                yield outcome
        finally:
            worker.close()


def kinds() -> list[str]:
    """Every kind there is a file of."""
    return list(dict.fromkeys(kind for _, kind, _ in files_of_kinds.WRITERS.values()))


def main() -> int:
    """Fuzz the kinds that the arguments name."""
    parser = argparse.ArgumentParser(description="Read spoilt files of every kind in a child.")
    parser.add_argument("--minutes", type=float, default=1.0, help="for each kind")
    parser.add_argument("--kind", nargs="*", default=kinds(), choices=kinds(), metavar="KIND")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    parser.add_argument("--keep", type=Path, default=Path("fuzzed"))
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    print(f"seed {options.seed}")
    for kind in options.kind:
        try:
            found = Counter(outcomes(kind, 60.0 * options.minutes, options.seed, options.keep))
        except AssertionError as error:
            print(f"{kind}: {error}", file=sys.stderr)
            return 1
        print(f"{kind}: {sum(found.values())} files")
        for outcome, count in found.most_common():
            print(f"    {count:6} {outcome}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
