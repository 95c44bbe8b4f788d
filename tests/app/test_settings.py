"""Service settings and the combinations that are rejected."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.settings import Settings, is_loopback, load_settings, unknown_variables
from identification.errors import OptionError


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "::1", "[::1]", "localhost"])
def test_loopback_addresses_are_recognised(host: str) -> None:
    """RFC 1122: 127/8; RFC 4291: ::1."""
    assert is_loopback(host)
    assert load_settings(host=host, no_auth=True).no_auth


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "10.0.0.1", "bench.example", "", "localhost."])
def test_service_without_keys_off_loopback_is_refused(host: str) -> None:
    """Any host that is not certainly loopback counts as a network."""
    assert not is_loopback(host)
    with pytest.raises(OptionError, match=r"no_auth with host .*loopback"):
        load_settings(host=host, no_auth=True)


def test_arguments_override_the_environment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An argument of None counts as not given."""
    monkeypatch.setenv("MOTORID_PORT", "9001")
    monkeypatch.setenv("MOTORID_HOST", "127.0.0.2")

    settings = load_settings(port=9002, host=None)

    assert (settings.port, settings.host) == (9002, "127.0.0.2")


def test_invalid_setting_is_named_on_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The command line shows this message to the user."""
    monkeypatch.setenv("MOTORID_PORT", "seventy")

    with pytest.raises(OptionError, match="^port: ") as caught:
        load_settings()

    assert "\n" not in str(caught.value)


def test_number_out_of_its_bounds_is_shown_with_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """As an argument and from the environment."""
    words = "^port is 99999; expected a number less than or equal to 65535$"
    with pytest.raises(OptionError, match=words):
        load_settings(port=99999)
    monkeypatch.setenv("MOTORID_PORT", "99999")
    with pytest.raises(OptionError, match=words):
        load_settings()


def test_lease_must_outlast_heartbeats() -> None:
    """One late heartbeat must not lose the lease."""
    with pytest.raises(OptionError, match="at least two heartbeats"):
        load_settings(lease_s=5.0, heartbeat_s=3.0)


def test_pipeline_must_be_a_function_of_a_module() -> None:
    """An invalid name would otherwise fail in each fit."""
    with pytest.raises(OptionError, match="^pipeline: "):
        load_settings(pipeline="rm -rf /")


def test_default_hosts_are_loopback_names() -> None:
    """On loopback only its names are accepted; on a network with keys, any name.

    Loopback names remain accepted, because health checks of the container use them.
    """
    assert load_settings().hosts == ("localhost", "127.0.0.1", "[::1]")
    assert load_settings(host="::1").hosts == ("localhost", "127.0.0.1", "[::1]")
    assert load_settings(host="0.0.0.0").hosts == ("*",)
    assert load_settings(host="0.0.0.0", allowed_hosts="a.example, b.example").hosts == (
        *("a.example", "b.example"),
        *("localhost", "127.0.0.1", "[::1]"),
    )


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "[::1]"])
def test_cluster_on_this_machine_needs_no_certificates(host: str) -> None:
    """Only processes of this machine can reach a loopback address."""
    assert load_settings(engine="dask", dask_scheduler=f"tcp://{host}:8786").engine == "dask"


@pytest.mark.parametrize(
    ("address", "words"),
    [
        (None, "expected tls://HOST:PORT"),
        ("scheduler:8786", "expected tls://HOST:PORT"),
        ("tcp://scheduler:8786", "without TLS expected a loopback address; use tls://"),
        ("tcp://10.0.0.7:8786", "without TLS expected a loopback address; use tls://"),
        ("tls://scheduler:8786", "dask_tls_ca_file is ''; .* expected a PEM file"),
    ],
)
def test_cluster_on_a_network_without_tls_is_refused(address: str | None, words: str) -> None:
    """A Dask scheduler executes any code that it receives."""
    with pytest.raises(OptionError, match=words):
        load_settings(engine="dask", dask_scheduler=address)


def test_secret_files_supply_settings_without_a_variable(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Docker and Kubernetes provide one file per secret, with a line end."""
    (tmp_path / "motorid_database_url").write_text("postgresql://user:pa55@host/base\n")
    (tmp_path / "motorid_port").write_text("9001")
    monkeypatch.setenv("MOTORID_SECRETS_DIR", str(tmp_path))
    monkeypatch.setenv("MOTORID_PORT", "9002")

    settings = load_settings()

    assert settings.database_url == "postgresql://user:pa55@host/base"
    assert settings.port == 9002
    monkeypatch.setenv("MOTORID_SECRETS_DIR", str(tmp_path / "none"))
    with pytest.raises(OptionError, match="is not a directory"):
        load_settings()


def test_password_of_the_database_is_not_shown() -> None:
    """Settings may appear in tracebacks and logs."""
    settings = load_settings(database_url="postgresql://user:pa55@host/base")

    assert "pa55" not in repr(settings)
    assert "pa55" not in str(settings)


def test_every_setting_has_a_description() -> None:
    """The table of settings in docs/operations.md consists of these descriptions."""
    for name, field in Settings.model_fields.items():
        assert field.description, name
        assert field.description[0].isupper(), name
        assert "." in field.description or "[" in field.description, name


def test_default_database_is_in_the_data_directory(tmp_path: Path) -> None:
    """A configured URL takes precedence."""
    plain = load_settings(data_dir=tmp_path)
    named = load_settings(data_dir=tmp_path, database_url="postgresql://host/base")

    assert plain.sqlalchemy_url == f"sqlite:///{tmp_path / 'motorid.sqlite3'}"
    assert named.sqlalchemy_url == "postgresql://host/base"


def test_unknown_variable_is_reported_with_the_nearest_name() -> None:
    """Variables of other commands and programs are not reported."""
    names = ["MOTORID_WORKER", "MOTORID_RETENTION", "motorid_port", "MOTORID_KEY", "PATH", "MOTOR"]

    assert unknown_variables(names) == {
        "MOTORID_WORKER": "MOTORID_WORKERS",
        "MOTORID_RETENTION": "MOTORID_RETENTION_DAYS",
    }
