"""Calls of the system that no reader needs, refused to a process for good (Linux, seccomp).

What Landlock does not look at: new processes, programs and sockets, owners, modes, times and
attributes of files. Threads may be made. Where the processor is another one nothing is refused.
"""

import ctypes
import errno
import platform
import struct

_X32 = 0x40000000
"""From here on calls of x86-64 are those of another convention."""

_CALLS = {
    "x86_64": (
        0xC000003E,
        56,
        (
            *(57, 58, 59, 322),  # fork, vfork, execve, execveat
            *(90, 91, 268, 92, 93, 94, 260),  # chmod, chown and their kin
            *(132, 235, 261, 280),  # utime and its kin
            *(188, 189, 190, 197, 198, 199),  # setxattr, removexattr
            *(109, 112, 41),  # setpgid, setsid, socket
        ),
    ),
    "aarch64": (
        0xC00000B7,
        220,
        (
            *(221, 281),  # execve, execveat
            *(52, 53, 54, 55),  # fchmod, fchmodat, fchownat, fchown
            88,  # utimensat
            *(5, 6, 7, 14, 15, 16),  # setxattr, removexattr
            *(154, 157, 198),  # setpgid, setsid, socket
        ),
    ),
}
"""By processor: its mark in a filter, the number of clone, and those of the calls refused."""

_EVERYWHERE = (425, 452, 463, 466, 469)
"""io_uring_setup, which goes past filters, fchmodat2, setxattrat, removexattrat, file_setattr."""

_CLONE3, _THREAD = 435, 0x10000
_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_NUMBER, _PROCESSOR, _FIRST_ARGUMENT = 0, 4, 16
_ALLOW, _FAIL = 0x7FFF0000, 0x00050000
_NO_NEW_PRIVILEGES, _SECCOMP, _FILTER = 38, 22, 2


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("steps", ctypes.c_char_p))


def filtered() -> bool:
    """Whether calls can be refused on this processor."""
    return platform.machine() in _CALLS


def refuse_calls(libc: ctypes.CDLL) -> None:
    """Let the calls fail from now on: EPERM."""
    if not filtered():
        return
    processor, clone, refused = _CALLS[platform.machine()]
    steps = [
        *(_step(_LOAD, _PROCESSOR), _step(_EQUAL, processor, 1, 0), _fail(errno.EPERM)),
        *(_step(_LOAD, _NUMBER), _step(_AT_LEAST, _X32, 0, 1), _fail(errno.EPERM)),
    ]
    for number in (*refused, *_EVERYWHERE):
        steps += [_step(_EQUAL, number, 0, 1), _fail(errno.EPERM)]
    # Its flags are out of a filter's sight; the C library then makes its threads by clone.
    steps += [_step(_EQUAL, _CLONE3, 0, 1), _fail(errno.ENOSYS)]
    steps += [_step(_EQUAL, clone, 0, 3), _step(_LOAD, _FIRST_ARGUMENT)]
    steps += [_step(_ANY_BIT, _THREAD, 1, 0), _fail(errno.EPERM), _step(_RETURN, _ALLOW)]
    program = _Program(len(steps), b"".join(steps))
    libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    libc.prctl(_SECCOMP, _FILTER, ctypes.byref(program), 0, 0)


def _step(code: int, value: int, if_true: int = 0, if_false: int = 0) -> bytes:
    return struct.pack("=HBBI", code, if_true, if_false, value)


def _fail(number: int) -> bytes:
    return _step(_RETURN, _FAIL | number)
