"""Service settings: environment variables with the prefix MOTORID_, or arguments.

    settings = load_settings(port=8080, data_dir=Path("bench"))

Unsafe combinations are rejected when the settings are read, not at the first request.
"""

from __future__ import annotations

import ipaddress
import os
import re
import socket
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from identification.errors import OptionError
from identification.threads import cores

__all__ = ["Settings", "is_loopback", "load_settings"]

_CLUSTER = re.compile(r"(?P<protocol>tcp|tls)://(?P<host>\[[0-9a-fA-F:.]+\]|[\w.-]+):[0-9]{1,5}")
_LOOPBACK_NAMES = ("localhost", "127.0.0.1", "[::1]")


def is_loopback(host: str) -> bool:
    """Return True if a server that listens on `host` is reachable from this machine only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


class Settings(BaseSettings):
    """Settings of the service; each is read from MOTORID_ and its name in capitals."""

    model_config = SettingsConfigDict(env_prefix="MOTORID_", extra="ignore", frozen=True)

    host: str = Field(default="127.0.0.1", description="Address to listen on.")
    port: int = Field(
        default=8000, ge=0, le=65535, description="Port to listen on; 0 takes a free one."
    )
    data_dir: Path = Field(
        default=Path("motorid-data"),
        description="Directory of the database, the runs and the results.",
    )
    no_auth: bool = Field(
        default=False, description="Answer without a key; accepted on a loopback address only."
    )
    allowed_hosts: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Host names that requests may carry besides the loopback names, separated by "
        "commas; `*` for any. Empty: `host`, or any where the service listens to a network.",
    )
    database_url: str | None = Field(
        default=None,
        repr=False,  # it may hold a password
        description="Address of the database, such as `postgresql://USER:PASSWORD@HOST/NAME`; "
        "empty: SQLite in the data directory.",
    )
    engine: Literal["local", "dask"] = Field(
        default="local", description="What computes fits: this machine, or a Dask cluster."
    )
    dask_scheduler: str | None = Field(
        default=None,
        description="Address of the cluster's scheduler, such as `tls://scheduler:8786`; "
        "`tcp://` is accepted on a loopback address only.",
    )
    dask_tls_ca_file: Path | None = Field(
        default=None, description="Certificate by which the cluster's certificates are checked."
    )
    dask_tls_cert_file: Path | None = Field(
        default=None, description="Certificate that this service shows to the cluster."
    )
    dask_tls_key_file: Path | None = Field(
        default=None, description="Private key of that certificate."
    )
    workers: int = Field(
        default_factory=cores,
        ge=1,
        le=1024,
        description="Fits that are computed at once; on a cluster, where it is not given, as many "
        "as it has threads.",
    )
    fit_threads: int | None = Field(
        default=None,
        ge=1,
        le=1024,
        description="Threads of one fit; where it is not given, a fit that begins has its share of "
        "the cores among those that run or wait, and on a cluster one.",
    )
    readers: int = Field(
        default_factory=cores, ge=1, le=256, description="Uploads that are read at once."
    )
    waiting_uploads: int = Field(
        default=16, ge=0, le=10_000, description="Uploads that may wait to be read beside them."
    )
    max_upload_bytes: int = Field(
        default=512_000_000, ge=1, description="Largest run file that is taken [bytes]."
    )
    max_body_bytes: int = Field(
        default=4_000_000, ge=1, description="Largest request other than an upload [bytes]."
    )
    max_rows: int = Field(default=10_000_000, ge=10, description="Most samples of one run.")
    upload_idle_s: float = Field(
        default=60.0,
        gt=0,
        description="An upload that sends nothing for this long is given up [s].",
    )
    upload_s: float = Field(
        default=3600.0,
        gt=0,
        description="An upload that is not complete after this time is given up [s].",
    )
    request_s: float = Field(
        default=20.0,
        gt=0,
        description="Any other request that is not complete after this time is given up, and a "
        "connection that sends none is closed [s].",
    )
    read_memory_bytes: int = Field(
        default=2_000_000_000,
        ge=300_000_000,
        description="Address space of a reading process [bytes].",
    )
    read_cpu_s: int = Field(
        default=60, ge=1, description="Processor time of a reading process [s]."
    )
    read_wall_s: float = Field(default=120.0, gt=0, description="Time of a reading process [s].")
    fit_wall_s: float = Field(
        default=6 * 3600.0, gt=0, description="A fit that takes longer than this has failed [s]."
    )
    max_attempts: int = Field(
        default=3, ge=1, le=100, description="Crashes of its process after which a fit has failed."
    )
    lease_s: float = Field(
        default=15.0,
        gt=0,
        description="A running fit whose server is silent this long is taken over [s].",
    )
    heartbeat_s: float = Field(
        default=3.0, gt=0, description="Interval in which a lease is renewed [s]."
    )
    checkpoint_s: float = Field(
        default=10.0,
        ge=0,
        description="Least time between two savings of a posterior in progress [s].",
    )
    session_s: float = Field(
        default=12 * 3600.0,
        gt=0,
        description="Time after which the web page asks for the key again [s].",
    )
    secure_cookies: bool = Field(
        default=False,
        description="Have browsers send the session's cookie over TLS alone; for a service behind "
        "a proxy that ends TLS.",
    )
    keep_alive_s: float = Field(
        default=15.0,
        gt=0,
        description="Interval of the comments that keep an event stream open [s].",
    )
    shutdown_s: float = Field(
        default=10.0, gt=0, description="Time that requests have to end when the service stops [s]."
    )
    rate_per_s: float = Field(
        default=50.0,
        ge=0,
        description="Calls that a key may make each second on average; 0: as many as it likes.",
    )
    rate_burst: int = Field(
        default=500, ge=1, description="Calls that a key may make at once before it has to wait."
    )
    streams_per_key: int = Field(
        default=64, ge=0, description="Event streams that a key may have open at once; 0: any."
    )
    quota_bytes: int = Field(
        default=0, ge=0, description="Bytes of run files that a workspace may keep [bytes]; 0: any."
    )
    quota_runs: int = Field(default=0, ge=0, description="Runs that a workspace may keep; 0: any.")
    quota_waiting_fits: int = Field(
        default=10_000, ge=0, description="Fits that a workspace may have waiting; 0: any."
    )
    retention_days: float = Field(
        default=0.0,
        ge=0,
        description="Days after which fits that ended, and runs that no fit needs, are removed; "
        "0: they are kept for good.",
    )
    sweep_s: float = Field(
        default=3600.0,
        gt=0,
        description="Interval in which the service looks for what can be removed [s].",
    )
    log_level: Literal["debug", "info", "warning", "error"] = Field(
        default="info", description="Least severe messages that are logged."
    )
    pipeline: str = Field(
        default="identification.pipeline:identify",
        pattern=r"^[A-Za-z_][\w.]*:[A-Za-z_]\w*$",
        description="Function that computes a fit, as module:function.",
    )

    @field_validator("allowed_hosts", mode="before")
    @classmethod
    def _split(cls, value: object) -> object:
        if isinstance(value, str):
            return tuple(name.strip() for name in value.split(",") if name.strip())
        return value

    @model_validator(mode="after")
    def _refuse_what_is_unsafe(self) -> Self:
        if self.no_auth and not is_loopback(self.host):
            raise ValueError(
                f"no_auth with host {self.host}: without keys the service listens on a loopback "
                "address only; leave out --no-auth and make a key with `motorid keys create`"
            )
        if self.lease_s < 2 * self.heartbeat_s:
            raise ValueError(
                f"lease_s is {self.lease_s:g} and heartbeat_s {self.heartbeat_s:g}; expected a "
                "lease of at least two heartbeats"
            )
        if self.engine == "dask":
            self._refuse_unsafe_cluster()
        return self

    def _refuse_unsafe_cluster(self) -> None:
        """Require TLS except on loopback: a Dask scheduler executes any code sent to it."""
        address = self.dask_scheduler or ""
        found = _CLUSTER.fullmatch(address)
        if found is None:
            raise ValueError(
                f"dask_scheduler is {address!r}; expected tls://HOST:PORT, or tcp://HOST:PORT on "
                "a loopback address"
            )
        if found["protocol"] == "tcp":
            if not is_loopback(found["host"]):
                raise ValueError(
                    f"dask_scheduler is {address}: without encryption and certificates a cluster "
                    "is used on a loopback address only; use tls:// and certificates"
                )
            return
        for name in ("dask_tls_ca_file", "dask_tls_cert_file", "dask_tls_key_file"):
            path: Path | None = getattr(self, name)
            if path is None or not path.is_file():
                raise ValueError(
                    f"{name} is {str(path or '')!r}; with tls:// expected a PEM file that can be "
                    "read"
                )

    @property
    def hosts(self) -> tuple[str, ...]:
        """Accepted names in the Host header, without a port."""
        if self.allowed_hosts:
            # Health checks use loopback names, and a page of another site cannot have one.
            return tuple(dict.fromkeys((*self.allowed_hosts, *_LOOPBACK_NAMES)))
        if is_loopback(self.host):
            bracketed = f"[{self.host}]" if ":" in self.host.strip("[]") else self.host
            return tuple(dict.fromkeys((*_LOOPBACK_NAMES, bracketed)))
        # Every call needs a key, and cookies are bound to the host name that set them.  So an
        # attacker gains nothing from another name for this address.
        return ("*",)

    @property
    def sqlalchemy_url(self) -> str:
        """URL of the database."""
        return self.database_url or f"sqlite:///{self.sqlite_file}"

    @property
    def sqlite_file(self) -> Path | None:
        """SQLite file in the data directory; None if another database is configured."""
        return None if self.database_url else self.data_dir.absolute() / "motorid.sqlite3"

    @property
    def node(self) -> str:
        """Host name of this machine, under which leases are held."""
        return socket.gethostname()[:64] or "localhost"


def load_settings(**given: object) -> Settings:
    """Settings from arguments, else from the environment.

    If MOTORID_SECRETS_DIR names a directory, a file there named like a variable (such as
    ``motorid_database_url``) supplies a setting that neither an argument nor the environment gives.

    Args:
        **given: Settings by name; None means not given.

    Raises:
        OptionError: The value of a setting is not accepted; the message is one line.
    """
    chosen: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    secrets = os.environ.get("MOTORID_SECRETS_DIR") or None
    if secrets is not None and not Path(secrets).is_dir():
        raise OptionError(f"MOTORID_SECRETS_DIR: {secrets} is no directory", value=secrets)
    try:
        return Settings(_secrets_dir=secrets, **chosen)  # type: ignore[call-arg]
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        name = ".".join(str(part) for part in first["loc"])
        text = first["msg"].removeprefix("Value error, ")
        raise OptionError(f"{name}: {text}" if name else text) from error
