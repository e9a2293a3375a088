"""What tests of the command line share."""

from ridetune.app.cli import main
from ridetune.engine.sensors import RECORDED as SENSED

PROGRAM = "import sys; from ridetune.app.cli import main; sys.exit(main())"

SHORT = {
    "name": "A short start over a rough road",
    "kind": "road",
    "duration": 4,
    "drive": {"kind": "reach-speed", "speed": 6, "time": 2, "start": 0.5, "ramp": 0.1},
    "road": {"kind": "iso8608", "sections": [{"class": "C"}]},
    "seed": 1,
}
RECORDED = list(SENSED)


def refused(capsys, *arguments):
    """Run a command that must fail on bad input; its one line on standard error."""
    try:
        status = main(arguments)
    except SystemExit as stop:
        status = stop.code
    printed = capsys.readouterr()
    assert status == 2
    assert printed.err.count("\n") == 1
    return printed.err.strip()
