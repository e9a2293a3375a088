"""A reader in a process of its own: however it goes wrong is one sentence, and it is confined."""

import os

import pytest
from ridetune.engine.errors import MeasurementError
from ridetune.engine.formats.child import Bounds
from ridetune.engine.formats.confine import landlock_version
from ridetune.engine.formats.opening import opened
from ridetune.engine.formats.syscalls import filtered
from ridetune.engine.measurement import parse_run

from .refusals import held, refusal


def slow(monkeypatch, code):
    """A reader that does something else, under the name of TDMS."""
    monkeypatch.setattr("ridetune.engine.formats.child.COMMAND", code)


STUB = (
    "import ridetune.engine.formats.answering as b; "
    "b.read_as = lambda *_: ({}); import ridetune.engine.formats.answers as a; a.main()"
)


@pytest.mark.parametrize(
    ("does", "bounds", "said"),
    [
        ("__import__('os').kill(__import__('os').getpid(), 11)", Bounds(), "crashed (SIGSEGV)"),
        ("__import__('os').kill(__import__('os').getpid(), 9)", Bounds(), "its reader was killed"),
        ("[0 for _ in iter(int, 1)]", Bounds(cpu=1), "more than 1 s of processor time"),
        (
            "__import__('time').sleep(60)",
            Bounds(wall=1.0),
            "took more than 1 s, as a damaged file may",
        ),
        ("bytearray(1 << 32)", Bounds(), "takes more than 2 GB of memory, as a damaged"),
        ("__import__('os').write(int(__import__('sys').argv[1]), b'{}' * 99)", Bounds(), "nothing"),
        ("open('garbage', 'wb').write(bytes(1 << 21))", Bounds(), "cannot be read as TDMS; it is"),
        ("1 / 0", Bounds(), "cannot be read as TDMS; it is damaged, cut short"),
    ],
)
def test_a_reader_gone_wrong_is_one_sentence(tmp_path, monkeypatch, does, bounds, said):
    """Oracle: what the reader was made to do."""
    slow(monkeypatch, STUB.format(does))
    path = held(tmp_path, "r.tdms", b"TDSm" + bytes(100))
    assert said in refusal(path, bounds)


def test_a_child_has_nothing_of_its_parents(tmp_path, monkeypatch):
    """No variables, no standard input, an empty folder that goes with it."""
    monkeypatch.setenv("RIDETUNE_TOKEN", "secret")
    code = (
        "(_ for _ in ()).throw(__import__('ridetune').engine.errors.MeasurementError("
        "str([__import__('os').environ.get('RIDETUNE_TOKEN'), __import__('sys').stdin.read(),"
        " __import__('os').listdir(), __import__('os').getcwd()]) + '.'))"
    )
    slow(monkeypatch, STUB.format(code))
    path = held(tmp_path, "r.tdms", b"TDSm" + bytes(100))
    with pytest.raises(MeasurementError) as caught, opened(path, "r.tdms"):
        pass
    said = str(caught.value)
    assert said.startswith("[None, '', [], ")
    assert not os.path.exists(said.split("'")[-2])


TRIES = """
import os, socket, subprocess, sys
tries = {
    "makes": lambda: open(victim + ".new", "w"),
    "writes": lambda: open(victim, "r+"),
    "truncates": lambda: os.truncate(victim, 0),
    "removes": lambda: os.unlink(victim),
    "renames": lambda: os.rename(victim, victim + ".new"),
    "reads": lambda: open(victim),
    "lists": lambda: os.listdir(os.path.dirname(victim)),
    "passwords": lambda: open("/etc/passwd"),
    "signals": lambda: os.kill(os.getppid(), 0),
    "chmods": lambda: os.chmod(victim, 0o777),
    "touches": lambda: os.utime(victim, (0, 0)),
    "forks": lambda: os.fork() or os._exit(0),
    "runs": lambda: subprocess.run([sys.executable, "-c", "0"]),
    "connects": lambda: socket.socket(),
    "escapes": os.setsid,
    "works": lambda: open("own", "w").write("1"),
}
done = []
for name, attempt in tries.items():
    try:
        attempt()
        done.append(name)
    except OSError:
        pass
import ridetune.engine.errors
raise ridetune.engine.errors.MeasurementError(" ".join(done) + ".")
"""


@pytest.mark.skipif(
    landlock_version() < 6 or not filtered(), reason="this system confines a child less"
)
def test_a_child_can_do_nothing_outside_its_folder(tmp_path, monkeypatch):
    """Nor read anything else, nor have processes of its own, which its limits would not end."""
    victim = tmp_path / "elsewhere" / "victim"
    victim.parent.mkdir()
    victim.write_text("kept")
    before = victim.stat()
    tries = f"victim = {str(victim)!r}\n{TRIES}"
    slow(monkeypatch, STUB.format(f"exec({tries!r}, {{}})"))
    path = held(tmp_path, "r.tdms", b"TDSm" + bytes(100))
    with pytest.raises(MeasurementError, match=r"^works\.$"), opened(path, "r.tdms"):
        pass
    assert victim.read_text() == "kept"
    assert list(victim.parent.iterdir()) == [victim]
    after = victim.stat()
    assert (after.st_mode, after.st_mtime_ns) == (before.st_mode, before.st_mtime_ns)


def test_text_from_strangers_is_refused_as_our_own_is():
    """The same sentence from the child as from this process."""
    data = b"time [s],chassis.z [mm]\n" + b"".join(b"%d,%d\n" % (k, k) for k in range(20))
    data += b"21,x\n"
    said = []
    for apart in (False, True):
        with pytest.raises(MeasurementError) as caught:
            parse_run(data, "run.csv", apart=apart)
        said.append(str(caught.value))
    assert said[0] == said[1]
    assert "line 22, column chassis.z [mm]: 'x' is not a number" in said[0]
