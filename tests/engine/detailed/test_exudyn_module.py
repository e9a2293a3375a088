"""Exudyn's import, which prints."""

import sys
from threading import Thread

from ridetune.engine.detailed.exudyn_module import require_exudyn


def test_threads_that_ask_at_once_leave_standard_output_where_it_was():
    """Oracle: the stream itself; threads change over as often as they can."""
    output, interval = sys.stdout, sys.getswitchinterval()
    threads = [Thread(target=lambda: [require_exudyn() for _ in range(2000)]) for _ in range(2)]
    sys.setswitchinterval(1e-5)
    try:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert sys.stdout is output
    finally:
        sys.setswitchinterval(interval)
        sys.stdout = output
