"""One story from upload to redesign, told to the service as it is deployed."""

import signal
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from ..app.jobs.dask_processes import DaskProcesses, dask_processes
from ..app.storage.postgresql_server import on_postgresql, postgresql
from .conftest import AWAY, SAMPLES, Service, add_file, short_run

__all__ = ["dask_processes", "on_postgresql", "postgresql"]

pytestmark = pytest.mark.browser

PRESSED = 150.0
"""How long a job may take after it was asked for, s."""


@dataclass
class Deployment:
    """How the service is started, and started again."""

    data: Path
    environment: dict[str, str] = field(default_factory=dict)

    def start(self, port: int = 0) -> Service:
        return Service(self.data, port, **self.environment)


@pytest.fixture(params=["embedded", "outgrown"])
def deployment(request, tmp_path) -> Deployment:
    """SQLite and workers of its own; PostgreSQL, and a scheduler and workers elsewhere by TLS."""
    data = tmp_path / "data"
    if request.param == "embedded":
        return Deployment(data)
    far: DaskProcesses = request.getfixturevalue("dask_processes")
    files = far.certificates
    return Deployment(
        data,
        {
            "RIDETUNE_DATABASE": request.getfixturevalue("on_postgresql"),
            "RIDETUNE_CLUSTER": far.address,
            "RIDETUNE_CLUSTER_CA": str(files.ca),
            "RIDETUNE_CLUSTER_CERT": str(files.certificate),
            "RIDETUNE_CLUSTER_KEY": str(files.key),
        },
    )


@pytest.mark.slow
def test_from_an_upload_over_a_crash_to_a_redesign(visit, deployment):
    """Upload, fit, kill -9 while a validation runs, and all goes on: the validation ends, the fit
    is applied, a slider is moved and kept, a virtual car is driven."""
    service = deployment.start()
    try:
        visitor = visit().open(service.address)
        visitor.expect(*AWAY)
        visitor.click("#tab-measurements")
        add_file(visitor, "my_ride.csv", short_run())
        visitor.until("ridetune.state('measurements').length === 3")

        visitor.click("#identify")
        visitor.until("ridetune.state('fit') !== null", PRESSED)
        found = visitor.look("ridetune.job().result.vehicle.front.suspension.stiffness")

        visitor.click("#tab-validation")
        visitor.click("#validate")
        visitor.until("ridetune.validation() !== null")
        service.stop(signal.SIGKILL)
        service = deployment.start(service.port)
        visitor.until("ridetune.validation().state === 'done'", PRESSED)
        visitor.wait(lambda: not visitor.element("#banner").is_visible(), "the page goes on")

        visitor.click("#tab-identification")
        visitor.click("#apply")
        visitor.settled()
        assert visitor.value("front.suspension.stiffness") == found
        before = visitor.line("chassis.pitch")
        slider = visitor.element("#value-front-suspension-stiffness")
        slider.fill("30")
        slider.blur()
        visitor.settled()
        assert np.abs(visitor.line("chassis.pitch") - before).max() > 1e-3
        visitor.wait(lambda: not visitor.look("ridetune.unsaved()"), "the slider is saved")

        visitor.click("#tab-measurements")
        visitor.page.locator("summary", has_text="Drive a campaign").click()
        visitor.click("#drive")
        visitor.until("ridetune.state('measurements').length === 5", PRESSED)

        visitor.page.reload()
        visitor.wait_until_drawn()
        assert visitor.value("front.suspension.stiffness") == pytest.approx(30e3)
        assert len(visitor.look("ridetune.state('measurements')")) == 5
        sample = (SAMPLES / "detailed/manoeuvre_1.csv").read_bytes()
        kept = visitor.page.evaluate(
            """async (sid) => {
                const runs = await (await fetch(`/api/sessions/${sid}/measurements`)).json();
                const path = `/api/sessions/${sid}/measurements/${runs[0].id}/original`;
                return (await fetch(path)).text();
            }""",
            visitor.look("ridetune.state('session')"),
        )
        assert kept.encode() == sample
    finally:
        service.stop()
