"""Shared server of the contract tests, with two workspaces and one key for each."""

from __future__ import annotations

import secrets
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.app.analysed import Bench, analysed
from tests.app.browser import launched
from tests.app.pending import Page
from tests.app.service import Caller, Server, make_key, run_text, serving

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """Browser of the tests of a module."""
    with launched() as browser:
        yield browser


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Server that requires keys and accepts run files of up to a million bytes."""
    data_dir = tmp_path_factory.mktemp("service") / "data"
    make_key(data_dir)
    with serving(
        data_dir,
        MAX_UPLOAD_BYTES=1_000_000,
        MAX_BODY_BYTES=100_000,
        KEEP_ALIVE_S=0.5,
        RATE_PER_S=0,
        LOG_LEVEL="debug",
    ) as running:
        yield running


@pytest.fixture(scope="session")
def open_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Server without keys, for tests that empty it first."""
    with serving(tmp_path_factory.mktemp("open") / "data", "--no-auth") as running:
        yield running


@pytest.fixture(scope="session")
def alice(server: Server) -> Iterator[Caller]:
    """Client of the workspace alice."""
    with Caller(server, make_key(server.data_dir, "alice")) as caller:
        yield caller


@pytest.fixture(scope="session")
def bob(server: Server) -> Iterator[Caller]:
    """Client of the workspace bob."""
    with Caller(server, make_key(server.data_dir, "bob")) as caller:
        yield caller


@pytest.fixture(scope="session")
def stored(alice: Caller) -> str:
    """ID of a permanent run of alice."""
    return str(alice.upload(run_text(0))["id"])


@pytest.fixture(scope="session")
def nobody(server: Server) -> Iterator[Caller]:
    """Client without a key."""
    with Caller(server) as caller:
        yield caller


@pytest.fixture
def page(server: Server) -> Iterator[Page]:
    """Start page of a workspace without runs."""
    with Page(server, f"pending-{secrets.token_hex(8)}") as opened:
        yield opened


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """Two runs of the 100 W servo, fitted alone and together."""
    with analysed(tmp_path_factory.mktemp("analyses")) as made:
        yield made


@pytest.fixture
def data_dir(tmp_path: Path) -> Path:
    """Data directory for a separate server."""
    return tmp_path / "data"


@pytest.fixture
def nothing_left(server: Server) -> Iterator[None]:
    """Check that the test adds neither a run nor an incoming file to the data directory."""
    before = sorted((server.data_dir / "runs").iterdir())
    yield
    assert sorted((server.data_dir / "runs").iterdir()) == before
    # A running fit of another test may hold temporary files until it ends.
    until = time.monotonic() + 60.0
    while list(server.data_dir.rglob("incoming/*/*")) and time.monotonic() < until:
        time.sleep(0.2)
    assert [path for path in server.data_dir.rglob("incoming/*/*")] == []
