"""What a process gives up before it opens a stranger's file: memory, time, files, the network.

Limits are those of POSIX. Where Linux has Landlock (5.13 on), nothing can be made, changed or
removed outside one folder (truncated from 6.2 on), and nothing read but what is told and what the
interpreter and its libraries are; from 6.7 on no TCP connection is opened, from 6.12 on no signal
sent to another process. A network namespace of its own takes the rest of the network where it may
be had; `syscalls` what else no reader needs. What the system does not offer is left out: the limits
on memory and time hold everywhere.
"""

import ctypes
import os
import resource
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from .syscalls import refuse_calls

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_VERSION, _PATH_BENEATH, _NO_NEW_PRIVILEGES = 1, 1, 38
_EXECUTE, _READ_FILE, _READ_FOLDER = 1 << 0, 1 << 2, 1 << 3
_WRITES = 0b1_1111_1111_0010
"""Landlock's rights to write, remove and make files of every sort (bits 1 and 4 to 12)."""

_TRUNCATE = 1 << 14
_TCP = 0b11
_OTHERS = 0b11
"""Abstract sockets and signals of processes outside."""

_NEW_NETWORK, _NEW_USER = 0x40000000, 0x10000000

_SYSTEM = (
    *("/lib", "/lib32", "/lib64", "/usr/lib", "/usr/lib32", "/usr/lib64", "/usr/local/lib"),
    *("/nix/store", "/gnu/store", "/usr/share/zoneinfo", "/etc/ld.so.cache", "/etc/localtime"),
    *("/dev/null", "/dev/urandom", "/proc/self", "/proc/cpuinfo", "/proc/meminfo", "/proc/stat"),
    "/sys/devices/system/cpu",
)
"""Where libraries and what they look at lie."""


class _Ruleset(ctypes.Structure):
    _fields_ = (
        ("files", ctypes.c_uint64),
        ("network", ctypes.c_uint64),
        ("scopes", ctypes.c_uint64),
    )


class _Beneath(ctypes.Structure):
    _pack_ = 1
    _fields_ = (("allowed", ctypes.c_uint64), ("place", ctypes.c_int32))


def confine(memory: int, cpu: int, wall: int, written: int, reads: Sequence[str]) -> None:
    """Confine this process for good; it may write in its working directory alone.

    memory : address space, bytes;  cpu : processor time, s;  wall : time until its end, s
    written : longest file it may write, bytes;  reads : files it may read, those that exist
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu + 1))
    resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))
    # A write beyond the limit then fails as on a full disk.
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (written, written))
    signal.alarm(wall)
    libc = ctypes.CDLL(None, use_errno=True)
    # As another user only where that does not take the right to read the file.
    if libc.unshare(_NEW_NETWORK) != 0 and os.geteuid() != 0:
        libc.unshare(_NEW_NETWORK | _NEW_USER)
    _keep_to(os.getcwd(), reads, libc)
    refuse_calls(libc)


def landlock_version() -> int:
    """The version of Landlock that the system has; 0 for none."""
    return _landlock_version(ctypes.CDLL(None, use_errno=True))


def _landlock_version(libc: ctypes.CDLL) -> int:
    size, flags = ctypes.c_size_t(0), ctypes.c_uint32(_VERSION)
    return max(int(libc.syscall(_CREATE_RULESET, None, size, flags)), 0)


def _keep_to(folder: str, reads: Sequence[str], libc: ctypes.CDLL) -> None:
    version = _landlock_version(libc)
    if version < 1:
        return
    writes = _WRITES | (_TRUNCATE if version >= 3 else 0)
    rules = _Ruleset(
        _EXECUTE | _READ_FILE | _READ_FOLDER | writes,
        _TCP if version >= 4 else 0,
        _OTHERS if version >= 6 else 0,
    )
    # The system takes what it does not know for an error.
    size = ctypes.c_size_t(24 if version >= 6 else 16 if version >= 4 else 8)
    number = libc.syscall(_CREATE_RULESET, ctypes.byref(rules), size, ctypes.c_uint32(0))
    if number < 0:
        return
    _allow(number, folder, writes | _READ_FILE | _READ_FOLDER, libc)
    engine = str(Path(__file__).parents[1])
    own = (engine, *sys.path, *(f"{one}/lib" for one in (sys.prefix, sys.base_prefix)))
    for place in (*filter(os.path.isabs, own), *_SYSTEM, *reads):
        _allow(number, place, _READ_FILE | _READ_FOLDER, libc)
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    libc.syscall(_RESTRICT_SELF, number, ctypes.c_uint32(0))
    os.close(number)


def _allow(ruleset: int, place: str, rights: int, libc: ctypes.CDLL) -> None:
    """Add what may be done beneath a folder, or with a file; nothing where there is none."""
    with suppress(OSError):
        number = os.open(place, os.O_PATH)
        if not os.path.isdir(place):
            rights &= ~_READ_FOLDER
        beneath = _Beneath(rights, number)
        kind, flags = ctypes.c_int(_PATH_BENEATH), ctypes.c_uint32(0)
        libc.syscall(_ADD_RULE, ruleset, kind, ctypes.byref(beneath), flags)
        os.close(number)
