"""Service settings: environment variables with the prefix MOTORID_, or arguments.

    settings = load_settings(port=8080, data_dir=Path("bench"))

Unsafe combinations are rejected when the settings are read, not at the first request.
"""

from __future__ import annotations

import difflib
import ipaddress
import os
import re
import socket
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from identification.errors import OptionError
from identification.threads import cores

__all__ = ["Settings", "is_loopback", "load_settings", "unknown_variables"]

_CLUSTER = re.compile(r"(?P<protocol>tcp|tls)://(?P<host>\[[0-9a-fA-F:.]+\]|[\w.-]+):[0-9]{1,5}")
# Variables of other commands, and the directory of the settings files.
_OTHERS = ("MOTORID_CACHE", "MOTORID_KEY", "MOTORID_SECRETS_DIR", "MOTORID_TRACEBACK")
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
    """Settings of the service; each is read from MOTORID_ and its name in capitals.

    The texts below the settings are their descriptions in docs/operations.md.
    """

    model_config = SettingsConfigDict(
        env_prefix="MOTORID_", extra="ignore", frozen=True, use_attribute_docstrings=True
    )

    host: str = "127.0.0.1"
    """Address to listen on."""
    port: int = Field(default=8000, ge=0, le=65535)
    """Port to listen on; 0 selects a free port."""
    data_dir: Path = Path("motorid-data")
    """Directory of the database, the runs and the results."""
    help_dir: Path | None = None
    """Directory of the documentation site that `make docs-site` has built, served under /help/
    without a key; empty: not served."""
    no_auth: bool = False
    """Accept requests without an API key; only on a loopback address."""
    allowed_hosts: Annotated[tuple[str, ...], NoDecode] = ()
    """Accepted names in the Host header in addition to the loopback names, separated by commas; `*`
    accepts any. Empty: only `host` on a loopback address, any otherwise."""
    database_url: str | None = Field(default=None, repr=False)  # it may hold a password
    """URL of the database, such as `postgresql://USER:PASSWORD@HOST/NAME`; empty: SQLite in the
    data directory."""
    engine: Literal["local", "dask"] = "local"
    """Engine that computes the fits: `local` (this machine) or `dask` (a cluster)."""
    dask_scheduler: str | None = None
    """Address of the Dask scheduler, such as `tls://scheduler:8786`; `tcp://` only on a loopback
    address."""
    dask_tls_ca_file: Path | None = None
    """CA certificate that verifies the certificates of the cluster (PEM)."""
    dask_tls_cert_file: Path | None = None
    """Client certificate of this service for the cluster (PEM)."""
    dask_tls_key_file: Path | None = None
    """Private key of the client certificate (PEM)."""
    workers: int = Field(default_factory=cores, ge=1, le=1024)
    """Number of fits computed in parallel; default on a cluster: its number of threads."""
    fit_threads: int | None = Field(default=None, ge=1, le=1024)
    """Threads per fit; empty: the cores divided by the number of running and queued fits at the
    start of the fit, and one thread on a cluster."""
    readers: int = Field(default_factory=cores, ge=1, le=256)
    """Number of uploads read in parallel."""
    waiting_uploads: int = Field(default=16, ge=0, le=10_000)
    """Number of further uploads that may wait to be read."""
    max_upload_bytes: int = Field(default=512_000_000, ge=1)
    """Maximum size of a run file [bytes]."""
    max_body_bytes: int = Field(default=4_000_000, ge=1)
    """Maximum size of the body of any other request [bytes]."""
    max_rows: int = Field(default=10_000_000, ge=10)
    """Maximum number of samples of a run."""
    upload_idle_s: float = Field(default=60.0, gt=0)
    """Time without data after which an upload is aborted [s]."""
    upload_s: float = Field(default=3600.0, gt=0)
    """Time limit of an upload [s]."""
    request_s: float = Field(default=20.0, gt=0)
    """Time limit for receiving any other request, and for an idle connection [s]."""
    read_memory_bytes: int = Field(default=2_000_000_000, ge=800_000_000)
    """Limit on the address space of a reader process, of which its libraries take 0.7 GB; at least
    800 MB [bytes]."""
    read_cpu_s: int = Field(default=60, ge=1)
    """Limit on the processor time of a reader process [s]."""
    read_wall_s: float = Field(default=120.0, gt=0)
    """Limit on the elapsed time of a reader process [s]."""
    fit_wall_s: float = Field(default=6 * 3600.0, gt=0)
    """Time limit of a fit, after which it fails [s]."""
    max_attempts: int = Field(default=3, ge=1, le=100)
    """Number of process crashes after which a fit fails."""
    lease_s: float = Field(default=15.0, gt=0)
    """Time without a heartbeat after which another server takes over a fit [s]."""
    heartbeat_s: float = Field(default=3.0, gt=0)
    """Interval between two renewals of a lease [s]."""
    checkpoint_s: float = Field(default=10.0, ge=0)
    """Minimum interval between two checkpoints of a chain [s]."""
    session_s: float = Field(default=12 * 3600.0, gt=0)
    """Lifetime of a browser session [s]."""
    secure_cookies: bool = False
    """Restrict the session cookie to TLS connections; for a service behind a proxy that terminates
    TLS."""
    keep_alive_s: float = Field(default=15.0, gt=0)
    """Interval between keep-alive comments in an event stream [s]."""
    shutdown_s: float = Field(default=10.0, gt=0)
    """Time limit for open requests at the shutdown of the service [s]."""
    rate_per_s: float = Field(default=50.0, ge=0)
    """Average number of calls per second and key; 0: unlimited."""
    rate_burst: int = Field(default=500, ge=1)
    """Number of calls per key in one burst (token bucket size)."""
    streams_per_key: int = Field(default=64, ge=0)
    """Number of open event streams per key; 0: unlimited."""
    quota_bytes: int = Field(default=0, ge=0)
    """Total size of the run files of a workspace [bytes]; 0: unlimited."""
    quota_runs: int = Field(default=0, ge=0)
    """Number of runs of a workspace; 0: unlimited."""
    quota_waiting_fits: int = Field(default=10_000, ge=0)
    """Number of queued fits of a workspace; 0: unlimited."""
    retention_days: float = Field(default=0.0, ge=0)
    """Age at which ended fits and unused runs are removed [days]; 0: never."""
    sweep_s: float = Field(default=3600.0, gt=0)
    """Interval between two searches for expired fits and runs [s]."""
    log_level: Literal["debug", "info", "warning", "error"] = "info"
    """Lowest severity of the logged messages."""
    pipeline: str = Field(
        default="identification.pipeline:identify", pattern=r"^[A-Za-z_][\w.]*:[A-Za-z_]\w*$"
    )
    """Function that computes a fit, in the form module:function."""

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
                f"no_auth with host {self.host}: expected a loopback address such as 127.0.0.1; "
                "omit --no-auth and create a key with `motorid keys create`"
            )
        if self.help_dir is not None and not (self.help_dir / "index.html").is_file():
            raise ValueError(
                f"help_dir is {self.help_dir}, which has no index.html; build it with `make "
                "docs-site`, or omit the setting"
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
                    f"dask_scheduler is {address}: without TLS expected a loopback address; use "
                    "tls:// with certificates"
                )
            return
        for name in ("dask_tls_ca_file", "dask_tls_cert_file", "dask_tls_key_file"):
            path: Path | None = getattr(self, name)
            if path is None or not path.is_file():
                raise ValueError(
                    f"{name} is {str(path or '')!r}; with tls:// expected a PEM file that exists"
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

    A setting of None counts as not given.

    Raises:
        OptionError: The value of a setting is not accepted; the message is one line.
    """
    chosen: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    secrets = os.environ.get("MOTORID_SECRETS_DIR") or None
    if secrets is not None and not Path(secrets).is_dir():
        raise OptionError(f"MOTORID_SECRETS_DIR: {secrets} is not a directory")
    try:
        return Settings(_secrets_dir=secrets, **chosen)  # type: ignore[call-arg]
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        name = ".".join(str(part) for part in first["loc"])
        text = first["msg"].removeprefix("Value error, ")
        # Only a number has bounds; other inputs may be secrets.
        if first["type"].startswith(("less_than", "greater_than")):
            text = text.replace("Input should be", "expected a number")
            raise OptionError(f"{name} is {first['input']}; {text}") from error
        raise OptionError(f"{name}: {text}" if name else text) from error


def unknown_variables(names: Iterable[str]) -> dict[str, str]:
    """Unknown names with the prefix MOTORID_, each with the most similar known name."""
    known = [*(f"MOTORID_{name.upper()}" for name in Settings.model_fields), *_OTHERS]
    unknown = [
        name for name in names if name.upper().startswith("MOTORID_") and name.upper() not in known
    ]
    return {name: difflib.get_close_matches(name.upper(), known, 1, 0.0)[0] for name in unknown}
