"""Kernels are made ready in the background: told, waited for, stopped with the service."""

import threading
import time

import psutil
import pytest
from ridetune.app.compile import PARTS, load_all
from ridetune.app.errors import Compiling, Unavailable
from ridetune.app.work import warmup as module
from ridetune.app.work.warmup import WarmUp
from ridetune.engine.kernel_cache import is_compiled

from ..live import LiveService


def test_work_waits_until_the_kernels_are_there():
    warmup = WarmUp(lambda warmup: warmup.tell("Compiling a wheel."))
    with pytest.raises(Compiling, match="^Loading the compiled") as refused:
        warmup.require()
    assert refused.value.headers == {"Retry-After": "1"}
    warmup.start()
    assert warmup.wait() is True
    assert warmup.state == "ready"
    warmup.require()


def test_a_failure_is_told_and_logged(caplog):
    def broken(*_) -> None:
        raise RuntimeError("no compiler")

    warmup = WarmUp(broken)
    warmup.start()
    assert warmup.wait() is True
    assert warmup.state == "failed"
    assert "log" in warmup.message
    assert "no compiler" in caplog.text
    with pytest.raises(Unavailable, match="could not be made ready") as refused:
        warmup.require()
    assert refused.value.headers == {"Retry-After": "30"}
    warmup.close()


def test_what_failed_is_tried_again(monkeypatch):
    monkeypatch.setattr(module, "RETRY_AFTER", 0.01)
    lacking = [MemoryError(), MemoryError()]

    def works_the_third_time(*_) -> None:
        if lacking:
            raise lacking.pop()

    warmup = WarmUp(works_the_third_time)
    warmup.start()
    deadline = time.monotonic() + 10
    while warmup.state != "ready":
        assert time.monotonic() < deadline
        time.sleep(0.01)
    warmup.require()


def test_what_the_end_of_the_service_overtakes_is_not_a_failure(caplog):
    closed, refused = threading.Event(), threading.Event()

    def overtaken(*_) -> None:
        closed.wait()
        refused.set()
        raise Unavailable("The service is about to end.")

    warmup = WarmUp(overtaken)
    warmup.start()
    warmup.close()
    closed.set()
    assert refused.wait(10)
    deadline = time.monotonic() + 10
    while warmup.state == "compiling":
        assert time.monotonic() < deadline
        time.sleep(0.01)
    assert caplog.text == ""


def test_a_cold_cache_is_filled_by_other_processes(monkeypatch):
    """That it takes long and what is done are told; afterwards the cache holds the kernels."""
    told: list[str] = []
    warmup = WarmUp(lambda warmup: warmup.compile_apart())
    monkeypatch.setattr(warmup, "tell", told.append)
    warmup.start()
    assert warmup.wait() is True
    *done, last = told
    assert [message.split(": ")[1] for message in done] == ["0 of 2 parts.", "1 of 2 parts."]
    assert all(message.startswith("Compiling the model; the first start") for message in done)
    assert last.startswith("Loading the compiled")
    assert is_compiled()


def test_stopping_the_service_stops_the_compiler(monkeypatch, tmp_path):
    """A cache of its own makes the processes compile for long; `close` does not wait for them."""
    monkeypatch.setenv("RIDETUNE_CACHE", str(tmp_path))
    told: list[str] = []
    warmup = WarmUp(lambda warmup: warmup.compile_apart())
    monkeypatch.setattr(warmup, "tell", told.append)
    warmup.start()
    deadline = time.monotonic() + 60
    while not told:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    compilers = [
        child for child in psutil.Process().children() if "ridetune.app.compile" in child.cmdline()
    ]
    assert len(compilers) == len(PARTS)
    warmup.close()
    assert warmup.wait() is False
    _, alive = psutil.wait_procs(compilers, timeout=10)
    assert alive == []


def test_a_service_is_ready_and_has_a_session_before_it_loads_scipy(tmp_path):
    """Simulators have it already. Oracle: the libraries in the process's memory."""
    with LiveService(tmp_path) as service:
        service.ready()
        assert service.client.post("/api/sessions").status_code == 201
        mapped = [part.path for part in psutil.Process(service.process.pid).memory_maps()]
    assert [path for path in mapped if "/numpy/" in path]
    assert not [path for path in mapped if "/scipy/" in path]


def test_every_part_can_be_taken_again():
    """Once more from the cache, here: what the service does after the other processes."""
    load_all()
