"""Jobs that are cancelled, or deleted with what they belong to; the cluster is a stand-in."""

from ..waiting import until
from .owned_jobs import state, submit


def test_a_waiting_job_is_cancelled_at_once(owner, clusters):
    """Whether it has reached the cluster or not, where it then does not stay."""
    job = submit(owner)["id"]
    assert owner.post(f"/identifications/{job}/cancel").status_code == 202
    assert state(owner, job) == "cancelled"
    last = submit(owner)["id"]
    until(lambda: set(clusters[-1].tasks) == {last})


def test_a_job_cancelled_while_it_is_handed_over_does_not_run(owner, clusters):
    """The cluster is told to cancel it once it knows it."""
    clusters[-1].meanwhile = lambda name: owner.post(f"/identifications/{name}/cancel")
    job = submit(owner)["id"]
    until(lambda: state(owner, job) == "cancelled")
    until(lambda: job in clusters[-1].cancelled)
    assert clusters[-1].tasks == {}


def test_a_running_job_is_asked_to_stop(owner, clusters):
    job = submit(owner)["id"]
    until(lambda: job in clusters[-1].tasks)
    clusters[-1].start(job)
    until(lambda: state(owner, job) == "running")
    assert owner.post(f"/identifications/{job}/cancel").status_code == 202
    until(lambda: state(owner, job) == "cancelled")
    again = owner.post(f"/identifications/{job}/cancel")
    assert (again.status_code, again.json()["state"]) == (202, "cancelled")


def test_a_deleted_job_is_gone_and_stopped(owner, clusters):
    job = submit(owner)["id"]
    until(lambda: job in clusters[-1].tasks)
    assert owner.delete(f"/identifications/{job}").status_code == 204
    assert owner.get(f"/identifications/{job}").status_code == 404
    until(lambda: job in clusters[-1].cancelled)


def test_a_deleted_session_stops_its_jobs(owner, clusters):
    job = submit(owner)["id"]
    until(lambda: job in clusters[-1].tasks)
    assert owner.delete().status_code == 204
    until(lambda: job in clusters[-1].cancelled)


def test_a_measurement_in_use_stays_until_its_job_has_ended(owner, clusters):
    job = submit(owner)
    measurement = f"/measurements/{job['runs'][0]['id']}"
    refused = owner.delete(measurement)
    assert refused.status_code == 409
    assert job["id"] in refused.json()["detail"]
    owner.post(f"/identifications/{job['id']}/cancel")
    assert owner.delete(measurement).status_code == 204
