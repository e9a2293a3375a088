"""Modules that several threads of a service import for the first time at once."""

import subprocess
import sys

# The first thread is held in the middle of a package until the second has begun to import ours.
AT_ONCE = """
import importlib, sys, threading, time

package, held_at, ours = sys.argv[1:]
held, begun, failed = threading.Event(), threading.Event(), []

class Hold:
    def find_spec(self, name, path, target=None):
        if name == held_at and threading.current_thread() is first:
            held.set()
            begun.wait()
            time.sleep(0.2)  # for the second to take its locks

def load(name):
    try:
        importlib.import_module(name)
    except ImportError as error:
        failed.append(error)

sys.meta_path.insert(0, Hold())
first = threading.Thread(target=load, args=[package])
first.start()
held.wait()
begun.set()
load(ours)
first.join()
sys.exit(str(failed) if failed else 0)
"""


def test_a_fit_may_be_imported_while_the_statistics_are():
    """A submodule that is imported by its own name, scipy.stats.qmc, locks itself and waits for its
    package, which waits for it: Python then shows one of them half made."""
    ours = "ridetune.engine.identification.identify"
    command = [sys.executable, "-c", AT_ONCE, "scipy.stats", "scipy.stats._stats_py", ours]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
