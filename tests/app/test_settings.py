"""Settings come from the environment; a wrong one is a sentence, a public bind needs a token."""

from pathlib import Path

import pytest
from ridetune.app.errors import StartError
from ridetune.app.settings import Settings, is_loopback


def test_an_argument_goes_before_the_environment_and_that_before_the_default():
    environment = {"RIDETUNE_PORT": "9000", "RIDETUNE_DATA": "/srv/ride", "HOME": "/nowhere"}
    settings = Settings.from_environment(port=9001, environment=environment)
    assert (settings.port, settings.data, settings.host) == (9001, Path("/srv/ride"), "127.0.0.1")


def test_limits_are_set_one_by_one():
    environment = {"RIDETUNE_LIMIT_UPLOAD_BYTES": "5000", "RIDETUNE_LIMIT_SIMULATED_SECONDS": "2.5"}
    limits = Settings.from_environment(data="x", environment=environment).limits
    assert (limits.upload_bytes, limits.simulated_seconds) == (5000, 2.5)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("RIDETUNE_PORT", "http"),
        ("RIDETUNE_PORT", "70000"),
        ("RIDETUNE_LIMIT_SESSIONS", "many"),
        ("RIDETUNE_LIMIT_SESSIONS", "-1"),
        ("RIDETUNE_LIMIT_SESSIONS", "2.5"),
        ("RIDETUNE_LIMIT_SIMULATED_SECONDS", "nan"),
    ],
)
def test_a_value_out_of_range_is_named(name, value):
    with pytest.raises(StartError, match=value):
        Settings.from_environment(data="x", environment={name: value})


def test_a_misspelt_limit_is_refused_with_the_nearest():
    with pytest.raises(StartError, match="did you mean RIDETUNE_LIMIT_SESSIONS?"):
        Settings.from_environment(data="x", environment={"RIDETUNE_LIMIT_SESIONS": "3"})


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.2", "car.example"])
def test_other_machines_need_a_token(host):
    assert not is_loopback(host)
    with pytest.raises(StartError, match="RIDETUNE_TOKEN"):
        Settings(data=Path("x"), host=host).check_bind()
    Settings(data=Path("x"), host=host, token="secret").check_bind()


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "::1", "localhost"])
def test_this_machine_needs_none(host):
    assert is_loopback(host)
    Settings(data=Path("x"), host=host).check_bind()


def test_the_service_answers_to_its_own_and_the_allowed_names():
    settings = Settings(data=Path("x"), host="0.0.0.0", allowed_hosts=("Ride.Example",))
    assert settings.host_names() == {"localhost", "127.0.0.1", "[::1]", "ride.example"}


def test_the_address_of_the_database_is_not_shown():
    """It may hold a password."""
    url = "postgresql://user:open-sesame@host/name"
    settings = Settings.from_environment(environment={"RIDETUNE_DATABASE": url})
    assert settings.database == url
    assert "open-sesame" not in repr(settings)
