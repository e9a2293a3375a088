"""The child's side: it opens one file, answers what it is asked about it, and ends.

Run as `python -I -c "from ...answers import main; main()"` by `child`, with the socket's number
and the limits as arguments. The limits are set before numpy or any reader is loaded. Whatever the
readers raise goes back as one sentence.
"""

import ctypes
import json
import os
import resource
import signal
import socket
import sys
import tempfile
import warnings

_NEW_NETWORK, _NEW_USER = 0x40000000, 0x10000000


def main() -> None:
    """Confine this process, then answer until the parent hangs up."""
    number, text = int(sys.argv[1]), sys.argv[2]
    limits = json.loads(text)
    _confine(**limits)
    # Else it is looked for by writing, which is forbidden.
    tempfile.tempdir = os.getcwd()
    speak = socket.socket(fileno=number)
    speak.setblocking(True)
    warnings.simplefilter("ignore")
    from . import wire
    from .answering import Answering

    answering = Answering(limits["memory"])
    while True:
        try:
            request, _ = wire.receive(speak, 0)
        except wire.Ended:
            break
        wire.send(speak, *answering.to(request))
    # Nothing of a library's own is worth running at the end.
    os._exit(0)


def _confine(memory: int, cpu: int, wall: int, written: int) -> None:
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu + 1))
    resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))
    # A write beyond the limit fails as if the disk were full.
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (written, written))
    signal.alarm(wall)
    libc = ctypes.CDLL(None, use_errno=True)
    # Without a network, where that may be had; as another user only where files stay readable.
    if libc.unshare(_NEW_NETWORK) != 0 and os.geteuid() != 0:
        libc.unshare(_NEW_NETWORK | _NEW_USER)
