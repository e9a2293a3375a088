"""What a process gives up before it opens a stranger's file: memory, time, files, the network.

Limits are those of POSIX. Where Linux has Landlock (5.13 on), nothing can be made, changed or
removed outside one folder, and from 6.7 on no TCP connection opened; a network namespace of its own
takes the rest of the network where it may be had. What the system does not offer is left out: the
limits on memory and time hold everywhere.
"""

import ctypes
import os
import resource
import signal

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_VERSION, _PATH_BENEATH, _NO_NEW_PRIVILEGES = 1, 1, 38
_WRITES = 0b1_1111_1111_0010
"""Landlock's rights to write, remove and make files of every sort (bits 1 and 4 to 12)."""

_TCP = 0b11
_NEW_NETWORK, _NEW_USER = 0x40000000, 0x10000000


class _Ruleset(ctypes.Structure):
    _fields_ = (("files", ctypes.c_uint64), ("network", ctypes.c_uint64))


class _Beneath(ctypes.Structure):
    _pack_ = 1
    _fields_ = (("allowed", ctypes.c_uint64), ("folder", ctypes.c_int32))


def confine(memory: int, cpu: int, wall: int, written: int) -> None:
    """Confine this process for good; it may write in its working directory alone.

    memory : address space, bytes;  cpu : processor time, s;  wall : time until its end, s
    written : longest file it may write, bytes
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
    _keep_writes_to(os.getcwd(), libc)


def landlock_version() -> int:
    """The version of Landlock that the system has; 0 for none."""
    return _landlock_version(ctypes.CDLL(None, use_errno=True))


def _landlock_version(libc: ctypes.CDLL) -> int:
    size, flags = ctypes.c_size_t(0), ctypes.c_uint32(_VERSION)
    return max(int(libc.syscall(_CREATE_RULESET, None, size, flags)), 0)


def _keep_writes_to(folder: str, libc: ctypes.CDLL) -> None:
    version = _landlock_version(libc)
    if version < 1:
        return
    rules = _Ruleset(_WRITES, _TCP if version >= 4 else 0)
    size = ctypes.c_size_t(ctypes.sizeof(rules) if version >= 4 else 8)
    number = libc.syscall(_CREATE_RULESET, ctypes.byref(rules), size, ctypes.c_uint32(0))
    if number < 0:
        return
    place = os.open(folder, os.O_PATH | os.O_DIRECTORY)
    beneath = _Beneath(_WRITES, place)
    libc.syscall(
        _ADD_RULE, number, ctypes.c_int(_PATH_BENEATH), ctypes.byref(beneath), ctypes.c_uint32(0)
    )
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    libc.syscall(_RESTRICT_SELF, number, ctypes.c_uint32(0))
    os.close(place)
    os.close(number)
