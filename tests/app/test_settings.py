"""Settings come from the environment; a wrong one is a sentence, a public bind a way to get in."""

import re
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from ridetune.app.addresses import is_loopback, networks
from ridetune.app.errors import StartError
from ridetune.app.settings import VARIABLES, Certificates, Settings

SERVICE = Path(__file__).parents[2] / "docs/service.md"
PROXY = {"proxy_user_header": "X-Forwarded-User", "proxy_addresses": networks("10.0.0.1")}


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
        ("RIDETUNE_GRACE", "-1"),
        ("RIDETUNE_NOTICE", "soon"),
        ("RIDETUNE_LOG", "xml"),
        ("RIDETUNE_LOG_LEVEL", "loud"),
        ("RIDETUNE_LIMIT_SESSIONS", "many"),
        ("RIDETUNE_LIMIT_SESSIONS", "-1"),
        ("RIDETUNE_LIMIT_SESSIONS", "2.5"),
        ("RIDETUNE_LIMIT_SIMULATED_SECONDS", "nan"),
        ("RIDETUNE_LOGIN", "no"),
        ("RIDETUNE_PUBLIC_URL", "ride.example.com"),
        ("RIDETUNE_PUBLIC_URL", "https://"),
        ("RIDETUNE_PUBLIC_URL", "https://ride.example.com/below"),
        ("RIDETUNE_PUBLIC_URL", "https://ride.example.com:port"),
        ("RIDETUNE_PUBLIC_URL", "ftp://ride.example.com"),
        ("RIDETUNE_PROXY_ADDRESSES", "10.0.0.1/24"),
        ("RIDETUNE_PROXY_ADDRESSES", "proxy"),
    ],
)
def test_a_value_out_of_range_is_named(name, value):
    with pytest.raises(StartError, match=value):
        Settings.from_environment(data="x", environment={name: value})


def test_a_scheduler_behind_tls_needs_its_three_files(tmp_path):
    names = ("CA", "CERT", "KEY")
    environment = {"RIDETUNE_CLUSTER": "tls://scheduler:8786"}
    for name in names:
        with pytest.raises(StartError, match=f"RIDETUNE_CLUSTER_{name} is not set"):
            Settings.from_environment(data="x", environment=environment)
        environment[f"RIDETUNE_CLUSTER_{name}"] = str(tmp_path / name)
        with pytest.raises(StartError, match=f"RIDETUNE_CLUSTER_{name} .* cannot be read"):
            Settings.from_environment(data="x", environment=environment)
        (tmp_path / name).touch()
    files = Settings.from_environment(data="x", environment=environment).certificates
    assert files == Certificates(*(tmp_path / name for name in names))
    with pytest.raises(StartError, match="only with a RIDETUNE_CLUSTER at tls://"):
        Settings.from_environment(data="x", environment=environment | {"RIDETUNE_CLUSTER": ""})


@pytest.mark.parametrize(
    ("misspelt", "told"),
    [
        ("RIDETUNE_LIMIT_SESIONS", "did you mean RIDETUNE_LIMIT_SESSIONS?"),
        ("RIDETUNE_PROXY_ADDRESS", "did you mean RIDETUNE_PROXY_ADDRESSES?"),
        ("RIDETUNE_TOKN", "did you mean RIDETUNE_TOKEN?"),
        ("RIDETUNE_CLUSTER_CERTIFICATE", "did you mean RIDETUNE_CLUSTER_CERT"),
        ("RIDETUNE_", "There is no setting RIDETUNE_;"),
        ("RIDETUNE_XQZ", "known are RIDETUNE_HOST"),
    ],
)
def test_a_misspelt_variable_is_refused_with_the_nearest(misspelt, told):
    """Whatever it is set to; its value, which may be a secret, is not repeated."""
    with pytest.raises(StartError, match=f"no setting {misspelt};") as refused:
        Settings.from_environment(data="x", environment={misspelt: "open-sesame"})
    assert told in str(refused.value)
    assert "open-sesame" not in str(refused.value)


def test_what_is_read_elsewhere_and_what_is_not_ours_is_let_be():
    environment = {"RIDETUNE_CACHE": "/var/cache/ridetune", "RIDE": "1", "PATH": "/bin"}
    assert Settings.from_environment(data="x", environment=environment) == Settings(data=Path("x"))


@pytest.mark.parametrize("variable", VARIABLES)
def test_every_variable_is_told_of(variable):
    """In a table of the documents, the parts of a common name being told by their ends."""
    told = re.findall(r"`(?:\.\.\.)?_?([A-Z_]+)`", SERVICE.read_text())
    name = variable.removeprefix("RIDETUNE_LIMIT_")
    assert {name, name.removeprefix("RIDETUNE_CLUSTER_")} & set(told)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.2", "car.example"])
def test_other_machines_need_a_token_a_key_or_a_proxy(host):
    assert not is_loopback(host)
    settings = Settings(data=Path("x"), host=host)
    with pytest.raises(StartError, match="RIDETUNE_TOKEN"):
        settings.check_bind()
    settings.check_bind(keys=True)
    replace(settings, token="secret").check_bind()
    replace(settings, **PROXY).check_bind()


@pytest.mark.parametrize("ways", [{}, {"keys": True}])
def test_no_other_machine_comes_without_login(ways):
    with pytest.raises(StartError, match="without login"):
        Settings(data=Path("x"), host="0.0.0.0", login=False).check_bind(**ways)


@pytest.mark.parametrize(
    ("told", "named"),
    [
        ({"login": False, "token": "secret"}, "RIDETUNE_TOKEN"),
        ({"login": False} | PROXY, "RIDETUNE_PROXY_USER_HEADER"),
        ({"login": False, "public_url": "https://ride.example.com"}, "RIDETUNE_PUBLIC_URL"),
        ({"proxy_user_header": "X-Forwarded-User"}, "RIDETUNE_PROXY_ADDRESSES"),
        ({"proxy_addresses": networks("10.0.0.1")}, "RIDETUNE_PROXY_USER_HEADER"),
    ],
)
def test_ways_in_that_contradict_each_other_are_refused(told, named):
    with pytest.raises(StartError, match=named):
        Settings(data=Path("x"), **told).check_bind()


@pytest.mark.parametrize(
    ("url", "told"),
    [
        ("https://Ride.Example.com/", "https://ride.example.com"),
        ("https://ride.example.com:443", "https://ride.example.com"),
        ("http://ride.example.com:8080", "http://ride.example.com:8080"),
        ("https://[2001:DB8::1]:8443", "https://[2001:db8::1]:8443"),
    ],
)
def test_the_public_address_is_taken_as_browsers_write_it(url, told):
    """Oracle: the origin of a page there, RFC 6454."""
    settings = Settings.from_environment(data="x", environment={"RIDETUNE_PUBLIC_URL": url})
    assert settings.public_url == told
    assert settings.https == told.startswith("https:")
    assert told.split("//")[1].removesuffix(":8080").removesuffix(":8443") in settings.host_names()


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "::1", "localhost"])
def test_this_machine_needs_nothing_of_that(host):
    assert is_loopback(host)
    Settings(data=Path("x"), host=host).check_bind()


def test_the_service_answers_to_its_own_and_the_allowed_names():
    settings = Settings(data=Path("x"), host="0.0.0.0", allowed_hosts=("Ride.Example",))
    assert settings.host_names() == {"localhost", "127.0.0.1", "[::1]", "ride.example"}


@pytest.mark.parametrize("token", ["a+b", "a/b=", "a b", "a&b", " ab", "ab\n"])
def test_a_token_that_an_address_changes_is_refused(token):
    """By `/?token=` it would let nobody in. The sentence does not repeat it."""
    with pytest.raises(StartError, match="RIDETUNE_TOKEN has characters") as refused:
        Settings.from_environment(data="x", environment={"RIDETUNE_TOKEN": token})
    assert token not in str(refused.value)


@pytest.mark.parametrize("token", ["abc", "0123456789abcde"])
def test_a_token_that_can_be_guessed_is_refused_with_what_makes_a_better_one(token):
    """Oracle: the command of the sentence, run; the sentence does not repeat the token."""
    with pytest.raises(StartError, match="fewer than 16 characters") as refused:
        Settings.from_environment(data="x", environment={"RIDETUNE_TOKEN": token})
    assert token not in str(refused.value)
    command = shlex.split(re.search("`(.*)`", str(refused.value))[1])
    made = subprocess.run([sys.executable, *command[1:]], capture_output=True, text=True)
    for good in (made.stdout.strip(), "0123456789abcdef"):
        settings = Settings.from_environment(data="x", environment={"RIDETUNE_TOKEN": good})
        assert settings.token == good


def test_an_address_of_ipv6_is_a_host_name_in_brackets():
    """Oracle: the Host header of RFC 9110, whose IP-literal is of RFC 3986."""
    environment = {"RIDETUNE_HOST": "fd00::1", "RIDETUNE_ALLOWED_HOSTS": "fd00::2, [fd00::3]"}
    names = Settings.from_environment(data="x", environment=environment).host_names()
    assert {"[fd00::1]", "[fd00::2]", "[fd00::3]"} <= names


@pytest.mark.parametrize("name", ["https://ride.example", "ride.example:8443", "*.ride.example"])
def test_what_no_host_header_has_is_no_allowed_name(name):
    """It would be answered to never, without a word why."""
    with pytest.raises(StartError, match="RIDETUNE_ALLOWED_HOSTS has"):
        Settings.from_environment(data="x", environment={"RIDETUNE_ALLOWED_HOSTS": name})


def test_the_address_of_the_database_is_not_shown():
    """It may hold a password."""
    url = "postgresql://user:open-sesame@host/name"
    settings = Settings.from_environment(environment={"RIDETUNE_DATABASE": url})
    assert settings.database == url
    assert "open-sesame" not in repr(settings)
