"""The page in Debian's chromium against a service of its own, as a visitor meets it.

A story looks inside the page through `window.ridetune` (see static/main.js). The page forbids
evaluated script, so waiting is done from here. Any console message of the page's that a story
does not expect fails it.
"""

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, Frame, Locator, Page, sync_playwright

CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-accelerated-2d-canvas",
]
PROGRAM = [sys.executable, "-c", "from ridetune.app.cli import main; raise SystemExit(main())"]
SAMPLES = Path(__file__).parents[2] / "sample_runs"
PATIENCE = 60.0
AWAY = (
    "ERR_CONNECTION_REFUSED",
    "ERR_CONNECTION_RESET",
    "ERR_INCOMPLETE_CHUNKED_ENCODING",
    "WebSocket connection",
    "ERR_EMPTY_RESPONSE",
    "status of 503",
)
"""What the browser says while the service is away."""
NOISE = re.compile(r"THREE\.Clock|GPU stall|WebGL.*software|swiftshader", re.IGNORECASE)


class Service:
    """`ridetune serve` as a process of its own, which lets everybody in unless there is a `login`.

    link : what lets one browser in then
    environment : further settings
    """

    def __init__(self, data: Path, port: int = 0, *, login: bool = False, **environment: str):
        self.data = data
        command = [*PROGRAM, "serve", "--data", str(data), "--port", str(port)]
        command += [] if login else ["--no-login"]
        self.log = (data.parent / f"{data.name}.log").open("ab")
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=self.log,
            env=os.environ | {"PYTHONUNBUFFERED": "1"} | environment,
            start_new_session=True,
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline().decode()
        found = re.search(r"http://127\.0\.0\.1:(\d+)/", line)
        assert found, f"the service did not start: {line or Path(self.log.name).read_text()}"
        self.port = int(found[1])
        self.address = found[0]
        self.link = line.split()[1]
        self._wait_until_ready()

    def _wait_until_ready(self) -> None:
        """Until the kernels are compiled; on a fresh machine that takes its time."""
        end = time.monotonic() + 180.0
        while time.monotonic() < end:
            try:
                with urllib.request.urlopen(f"{self.address}readyz"):
                    return
            except urllib.error.HTTPError as compiling:
                compiling.close()
                time.sleep(0.3)
        raise AssertionError("the service is still compiling after three minutes")

    def stop(self, how: signal.Signals = signal.SIGTERM) -> None:
        """End it, with its workers."""
        if self.process.poll() is None:
            if how is signal.SIGKILL:
                os.killpg(self.process.pid, how)
            else:
                self.process.send_signal(how)
        self.process.wait(30)
        assert self.process.stdout is not None
        self.process.stdout.close()
        self.log.close()


@dataclass
class Visitor:
    """A browser of its own with the page open."""

    page: Page
    in_3d: bool = True
    expected: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)

    def open(self, address: str) -> "Visitor":
        """Go to the start page and wait for the first charts and the car."""
        self.page.goto(f"{address}?fixedDpr=0.4")
        self.wait_until_drawn()
        return self

    def wait_until_drawn(self) -> None:
        """Until a simulated ride is drawn, in charts and in 3D."""
        scene = "ridetune.scene.built" if self.in_3d else "true"
        self.until(f"ridetune.state('now') !== null && {scene}")

    def look(self, expression: str) -> Any:
        """Value of an expression in the page; `ridetune` is window.ridetune."""
        return self.page.evaluate(
            f"() => {{ const ridetune = window.ridetune; return ({expression}); }}"
        )

    def until(self, expression: str, seconds: float = PATIENCE) -> None:
        """Wait until an expression holds."""
        self.wait(
            lambda: self.look(f"ridetune ? Boolean({expression}) : false"), expression, seconds
        )

    def wait(self, holds: Callable[[], Any], what: str, seconds: float = PATIENCE) -> None:
        """Wait until something holds."""
        end = time.monotonic() + seconds
        while not holds():
            assert time.monotonic() < end, f"not within {seconds:g} s: {what}"
            self.page.wait_for_timeout(50)

    def element(self, selector: str, *, has_text: str | None = None) -> Locator:
        """An element by its selector, of those with a text in them."""
        return self.page.locator(selector, has_text=has_text)

    def click(self, selector: str) -> None:
        """Click an element."""
        self.page.click(selector)

    def value(self, parameter: str) -> float:
        """A slider's value, SI."""
        return self.look(f"ridetune.state('values')['{parameter}']")

    def line(self, channel: str, run: str = "now") -> np.ndarray:
        """What a chart draws of a run, in display units."""
        return np.array(self.look(f"ridetune.drawn()['{channel}']['{run}']"), dtype=float)

    def settled(self) -> None:
        """Until nothing is asked of the service any more."""
        self.page.wait_for_timeout(100)
        self.until("ridetune.idle()")

    def scene_frame(self) -> Frame:
        """The document of the 3D view."""
        frame = self.page.query_selector("#view iframe").content_frame()
        assert frame is not None
        return frame

    def picture(self) -> np.ndarray:
        """The 3D view as (height, width, 3) bytes, once it has come to rest, without messages."""
        for message in self.element(".notice .dismiss").all():
            message.click()
        last = None
        for _ in range(40):
            self.page.wait_for_timeout(150)
            now = imageio.imread(io.BytesIO(self.element("#view iframe").screenshot()))[..., :3]
            if last is not None and np.array_equal(now, last):
                return now
            last = now
        raise AssertionError("the 3D view does not come to rest")

    def expect(self, *patterns: str) -> None:
        """Console messages that this story causes on purpose."""
        self.expected.extend(patterns)

    def unexpected(self) -> list[str]:
        """Complaints of the page that no one asked for."""
        return [
            text
            for text in self.complaints
            if not NOISE.search(text) and not any(re.search(one, text) for one in self.expected)
        ]


def add_file(visitor: Visitor, name: str, data: bytes) -> None:
    """Choose a file on the page."""
    visitor.page.set_input_files("#file", [{"name": name, "mimeType": "text/csv", "buffer": data}])


def take_car_without_brakes(visitor: Visitor) -> None:
    """Add the sample car's file, less its brakes, as one more file."""
    car = json.loads((SAMPLES / "detailed/vehicle.json").read_text())
    del car["brakes"]
    visitor.click("#tab-measurements")
    add_file(visitor, "car.json", json.dumps(car).encode())
    visitor.until("ridetune.state('vehicle').brakes == null")


def free_only(visitor: Visitor, *symbols: str) -> None:
    """Leave these parameters free and fix the others."""
    visitor.click("#identification >> text=Set-up")
    for row in visitor.element(".free tbody tr").all():
        symbol = row.locator(".symbol").inner_text().replace("\n", "")
        if symbol not in symbols:
            row.locator("input[type=checkbox]").uncheck()


def changed_pixels(one: np.ndarray, other: np.ndarray) -> float:
    """Share of the pixels that differ visibly."""
    return float(np.mean(np.abs(one.astype(int) - other).max(axis=2) > 24))


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    if not Path(CHROMIUM).exists():
        pytest.fail(
            f"The browser tests need {CHROMIUM}; install it with `apt-get install chromium`.",
            pytrace=False,
        )
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="package")
def service(tmp_path_factory) -> Iterator[Service]:
    service = Service(tmp_path_factory.mktemp("browser") / "data")
    yield service
    service.stop()


@contextmanager
def visits(browser: Browser) -> Iterator[Callable[..., Visitor]]:
    """Makes visitors; each has cookies, and so a session, of its own, or sits `beside` another.

    Drawing in software is slow: the 3D view is small, and empty in stories that are not about it.
    """
    contexts: list[BrowserContext] = []
    visitors: list[Visitor] = []

    def arrive(in_3d: bool = False, beside: Visitor | None = None) -> Visitor:
        size = (1120, 640) if in_3d else (1366, 768)
        if beside is None:
            context = browser.new_context(viewport={"width": size[0], "height": size[1]})
            contexts.append(context)
        else:
            context = beside.page.context
        visitor = Visitor(context.new_page(), in_3d)
        if not in_3d:
            visitor.page.route("**/viewer/*", lambda route: route.fulfill(body="<!doctype html>"))
        visitors.append(visitor)
        visitor.page.on(
            "console",
            lambda said: (
                visitor.complaints.append(said.text) if said.type in ("error", "warning") else None
            ),
        )
        visitor.page.on("pageerror", lambda error: visitor.complaints.append(str(error)))
        return visitor

    yield arrive
    complaints = [text for visitor in visitors for text in visitor.unexpected()]
    for context in contexts:
        context.close()
    assert complaints == []


@pytest.fixture
def visit(browser) -> Iterator[Callable[..., Visitor]]:
    with visits(browser) as arrive:
        yield arrive


@pytest.fixture
def visitor(visit, service) -> Visitor:
    """On the page, without the 3D view."""
    return visit().open(service.address)


@pytest.fixture
def spectator(visit, service) -> Visitor:
    """On the page, with the 3D view."""
    return visit(in_3d=True).open(service.address)


def short_run(samples: int = 700, first: int = 900) -> bytes:
    """Some seconds of the first sample run, from the torque's start on."""
    lines = (SAMPLES / "detailed/manoeuvre_1.csv").read_bytes().split(b"\n")
    return b"\n".join([lines[0], *lines[1 + first : 1 + first + 2 * samples : 2]]) + b"\n"
