"""The child's side: it opens one file, answers what it is asked about it, and ends.

`child` runs `main` with the socket's number and the limits as arguments. The limits are set before
numpy or any reader is loaded. Whatever the readers raise goes back as one sentence.
"""

import json
import os
import socket
import sys
import tempfile
import warnings

from .confine import confine


def main() -> None:
    """Confine this process, then answer until the parent hangs up."""
    limits = json.loads(sys.argv[2])
    confine(**limits)
    # Else it is looked for by writing wherever that might be allowed.
    tempfile.tempdir = os.getcwd()
    speak = socket.socket(fileno=int(sys.argv[1]))
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
