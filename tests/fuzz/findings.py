"""What came of the files of a kind, and what counts as a sentence for a person."""

import re
import resource
import sys
import traceback
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from ridetune.engine.errors import RideError

SLOWEST = 10.0
"""Processor time that a file of some kilobytes may take, here or in the child, s."""

LONGEST = 1200
"""Longest sentence, characters."""

GARBAGE = re.compile(
    r"Traceback|(^|[(\[:=] ?)b['\"]|\\x[0-9a-f]{2}|<class|object at 0x|dtype\("
    r"|array\(|codec|recursion|',\)|np\.\w+\(|/tmp/"
)
"""What only a programmer understands."""


@dataclass
class Tally:
    """What came of the files of one kind: how often which outcome, and what must not come."""

    outcomes: Counter[str] = field(default_factory=Counter)
    findings: Counter[str] = field(default_factory=Counter)
    cpu: float = 0.0
    memory: float = 0.0
    seconds: float = 0.0

    def found(self, error: Exception, data: dict[str, bytes], keep: Path) -> str:
        """Count a finding; keep the files of the first one.

        data : by name
        """
        name = next(iter(data))
        outcome = f"{type(error).__name__}: {shape(str(error), name)}"
        if "too long" in outcome:
            outcome = "AssertionError: too long"
        self.findings[outcome] += 1
        if self.findings[outcome] == 1:
            keep.mkdir(parents=True, exist_ok=True)
            mark = f"{zlib.crc32(data[name]):08x}-"
            for one, held in data.items():
                (keep / f"{mark}{one}").write_bytes(held)
            print(f"kept {keep / f'{mark}{name}'}: {outcome}", file=sys.stderr)
            if not isinstance(error, AssertionError):
                traceback.print_exception(error)
        return outcome

    def told(self, kind: str) -> str:
        """As lines of text."""
        here = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        lines = [
            f"{kind}: {sum(self.outcomes.values())} files in {self.seconds:.0f} s, at most"
            f" {self.cpu:.1f} s of processor time and {self.memory:.0f} MB each, {here:.0f} MB"
            f" here; {len(self.findings)} findings"
        ]
        lines += [f"  FINDING {count:5} {one}" for one, count in self.findings.most_common()]
        return "\n".join(lines + [f"    {n:6} {one}" for one, n in self.outcomes.most_common(60)])


def sentence(error: object, name: str) -> str:
    """What an error says, checked to be a sentence that begins with the file's name."""
    said = str(error)
    assert said.startswith(name), f"names no file: {said}"
    assert said.endswith((".", "?")), f"no sentence: {said}"
    check_text(said)
    return said


def check_text(said: str) -> None:
    """AssertionError for what is no text of one line for a person."""
    assert not GARBAGE.search(said), f"a programmer's words: {said}"
    assert len(said) < LONGEST, f"too long: {said}"
    assert len(said.splitlines()) == 1, f"not one line: {said!r}"


@contextmanager
def refused(name: str, never: bool = False) -> Iterator[None]:
    """A block that may end with one of our errors, whose sentence is checked.

    never : it may not, for the file is sound
    """
    try:
        yield
    except RideError as error:
        said = sentence(error, name)
        if never:
            raise AssertionError(f"sound, but refused: {said}") from error


def shape(said: str, name: str) -> str:
    """A sentence without what differs from file to file."""
    said = re.sub(r"'.*'|\".*\"", "'...'", said.replace(name, "FILE"))
    said = re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", said)
    said = re.sub(
        r"(column|file has no column|quantity # of its description,) .*?[:,] ", r"\1 ...: ", said
    )
    return said[:160].encode("ascii", "replace").decode()
