"""Small tasks for the cluster's tests, sent to the workers by value."""

import os
import time


def double(payload, attempt):
    """Report twice, then give the payload doubled, with the priority and process it ran at."""
    attempt.report({"cost": 1.0})
    time.sleep(0.15)
    attempt.report({"cost": 0.5})
    return {
        "value": 2 * payload,
        "priority": os.getpriority(os.PRIO_PROCESS, 0),
        "process": os.getpid(),
    }


def wait(payload, attempt):
    """Wait to be cancelled, looking every few milliseconds."""
    from ridetune.engine.errors import Cancelled

    attempt.report({"cost": 1.0})
    until = time.monotonic() + 60
    while time.monotonic() < until:
        if attempt.cancelled():
            raise Cancelled("stopped")
        time.sleep(0.005)
    return {"value": "never cancelled"}


def ignore(payload, attempt):
    """Compute on, whatever is asked, and tell in which process."""
    attempt.report({"process": os.getpid()})
    until = time.monotonic() + 60
    while time.monotonic() < until:
        time.sleep(0.01)
    return {"value": "never killed"}


def note(payload, attempt):
    """Log a record; what it is as a line, in this process."""
    import logging

    from ridetune.app.logs import JsonLines

    log = logging.getLogger("ridetune.task")
    formatter = logging.getLogger().handlers[0].formatter
    return {
        "formatter": type(formatter).__name__,
        "line": JsonLines().format(log.makeRecord(log.name, 30, "", 0, payload, (), None)),
    }


def write(payload, attempt):
    """Make a file."""
    from ridetune.app.jobs.worker import WithFile

    return WithFile({"rows": len(payload)}, payload)


def poison(payload, attempt):
    """Take the worker down."""
    os._exit(9)


def halfway(payload, attempt):
    """Keep a part on the way."""
    attempt.keep("half", payload)
    return {}


def refuse(payload, attempt):
    """Find something that the caller can mend."""
    from ridetune.engine.errors import SimulationDiverged

    raise SimulationDiverged(1.25, "chassis.roll", "soften it.")


def crash(payload, attempt):
    """Fail in a way nobody foresaw."""
    raise ZeroDivisionError("secret detail")


def die_once(payload, attempt):
    """Take the first worker down, succeed on the second."""
    from pathlib import Path

    if not Path(payload).exists():
        Path(payload).touch()
        os._exit(9)
    return {"value": "second time"}


def kept(payload, attempt):
    """Tell what is kept."""
    return {name: data.hex() for name, data in attempt.kept.items()}


def asked(payload, attempt):
    """Wait for a file; whether this was asked to stop by then."""
    attempt.report({"cost": 1.0})
    until = time.monotonic() + 60
    while not os.path.exists(payload) and time.monotonic() < until:
        time.sleep(0.005)
    return {"asked": attempt.cancelled()}
