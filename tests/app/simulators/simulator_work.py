"""Small pieces of work for simulators, which import them by name."""

import os
import signal
import sys
import time

from ridetune.engine.errors import SimulationDiverged


def process(host):
    """In which process it runs, and whether what simulates is there already."""
    return os.getpid(), "ridetune.engine.simulation.simulate" in sys.modules


def asked(host, what, *about):
    return host.ask(what, *about)


def length(host, data):
    return len(data)


def run_of(host, measurement):
    return host.recordings.run(measurement)


def motions(host, measurements, settings):
    """How many motions are made of some measurements."""
    made = [host.recordings.motion(one, settings, None) for one in measurements]
    return len({id(one.stage_inputs) for one in made})


def diverged(host):
    raise SimulationDiverged(1.5, "chassis.z", "take a shorter step.")


def broken(host):
    return 1 / 0


def killed(host):
    os.kill(os.getpid(), signal.SIGKILL)


def killed_once(host, mark):
    """End the process the first time, and tell the one of the second."""
    if not os.path.exists(mark):
        with open(mark, "w"):
            killed(host)
    return os.getpid()


def told_to_end(host):
    """Be told to end as by a service manager or a terminal, and go on."""
    for number in (signal.SIGTERM, signal.SIGINT):
        os.kill(os.getpid(), number)
    return "done"


def slept(host, seconds):
    time.sleep(seconds)
