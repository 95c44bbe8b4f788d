"""Damaged databases: detected at the start, or reported with a code when detected later."""

from __future__ import annotations

import contextlib
import os
import sqlite3
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from app.cli import main
from app.damage import check_file
from app.database import Database
from app.identifiers import new_id
from app.settings import load_settings
from app.storage import Storage
from tests.app.rows import run_row
from tests.app.service import API, make_key, serving

DATABASE = "motorid.sqlite3"


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Data directory with a hundred runs in the database and one run file."""
    settings = load_settings(data_dir=tmp_path / "data")
    storage = Storage(settings.data_dir, settings.node)
    storage.prepare()
    database = Database(settings.sqlalchemy_url)
    database.migrate()
    with database.writing() as session:
        session.add_all([run_row("default") for _ in range(100)])
    database.close()
    storage.run(new_id("run")).write_bytes(b"x")
    return settings.data_dir


def overwrite(file: Path, begin: int, size: int) -> None:
    """Overwrite part of a file with a byte that begins no database page."""
    with file.open("r+b") as content:
        content.seek(begin)
        content.write(b"\xa5" * size)


DAMAGES: dict[str, Callable[[Path], None]] = {
    "garbage": lambda file: overwrite(file, 0, file.stat().st_size),
    "truncated": lambda file: os.truncate(file, file.stat().st_size // 2),
    "truncated within a page": lambda file: os.truncate(file, 5000),
    "two pages": lambda file: overwrite(file, 40960, 8192),
    "empty": lambda file: os.truncate(file, 0),
    "missing": lambda file: file.unlink(),
}


@pytest.mark.parametrize("command", ["serve", "backup"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_database_is_named_with_the_remedy(
    data: Path,
    damage: str,
    command: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One line names the file and the restore command; the run files are unchanged."""
    DAMAGES[damage](data / DATABASE)
    words = ["backup", str(data.parent / "saved.tar")] if command == "backup" else ["serve"]
    port = ["--port", "0", "--no-auth"] if command == "serve" else []
    monkeypatch.setattr("app.server.configure_logging", lambda level: None)
    before = sorted((data / "runs").iterdir())

    status = main([*words, *port, "--data-dir", str(data)])

    line = capsys.readouterr().err
    assert status == 1
    assert line.count("\n") == 1
    assert f"{data / DATABASE}: is " in line
    assert f"motorid restore BACKUP --data-dir {data}" in line
    assert "internal error" not in line
    assert sorted((data / "runs").iterdir()) == before


@pytest.mark.parametrize("damage", ["garbage", "truncated", "empty", "missing"])
def test_key_list_of_a_damaged_database_fails_with_one_line(
    data: Path, damage: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A silently recreated database would hide the damage from the next start."""
    DAMAGES[damage](data / DATABASE)

    assert main(["keys", "list", "--data-dir", str(data)]) == 1
    shown = capsys.readouterr().err
    assert shown.count("\n") == 1
    assert f"{data / DATABASE}: is " in shown


def test_intact_or_missing_database_passes_the_check(data: Path) -> None:
    """A missing file passes, because the service creates it."""
    check_file(data / DATABASE)
    check_file(data / "none")


def test_damage_found_later_is_a_problem_and_fails_readiness(tmp_path: Path) -> None:
    """A row with invalid JSON gives 503; other tables are still served."""
    data = tmp_path / "data"
    key = make_key(data)
    with serving(data) as server:
        url, headers = server.url + API, {"Authorization": f"Bearer {key}"}
        assert httpx.get(f"{url}/runs", headers=headers).status_code == 200
        with contextlib.closing(sqlite3.connect(data / DATABASE, timeout=30)) as database:
            values = ("run_" + "a" * 26, "{\x00")
            database.execute(
                "INSERT INTO runs (id, channels, workspace, sha256, mapping_sha256, file, bytes,"
                " rows, sample_rate_hz, duration_s, warnings, created_at)"
                " VALUES (?, ?, 'default', '', '', '', 1, 1, 1, 1, '[]', 1)",
                values,
            )
            database.commit()

        answer = httpx.get(f"{url}/runs", headers=headers)
        ready = httpx.get(f"{server.url}/readyz")
        fits = httpx.get(f"{url}/fits", headers=headers)

    assert (answer.status_code, answer.json()["code"]) == (503, "database_damaged")
    assert "retry-after" not in answer.headers
    assert (ready.status_code, ready.json()["checks"]["database"]) == (503, False)
    assert fits.status_code == 200


def test_overwritten_pages_of_a_running_service_are_a_problem(tmp_path: Path) -> None:
    """Authentication is the first to read a damaged page."""
    data = tmp_path / "data"
    key = make_key(data)
    with serving(data) as server:
        headers = {"Authorization": f"Bearer {key}"}
        file = data / DATABASE
        overwrite(file, 4096, file.stat().st_size - 4096)
        # SQLite caches pages until the change counter in the first page changes.
        overwrite(file, 24, 4)

        answers = [
            httpx.get(f"{server.url}{API}/{name}", headers=headers) for name in ("runs",) * 3
        ]
        ready = httpx.get(f"{server.url}/readyz")
        alive = httpx.get(f"{server.url}/healthz")

    assert {a.json()["code"] for a in answers} == {"database_damaged"}
    assert {a.status_code for a in answers} == {503}
    assert ready.status_code == 503
    assert alive.status_code == 200


def test_url_is_printed_only_with_the_lock_held(
    data: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A printed URL implies that the server is about to answer there."""
    monkeypatch.setattr("app.server.configure_logging", lambda level: None)
    first = Storage(data, load_settings(data_dir=data).node)
    first.lock.take()

    status = main(["serve", "--port", "0", "--no-auth", "--data-dir", str(data)])

    first.lock.release()
    shown = capsys.readouterr().err
    assert status == 2
    assert "another server already uses" in shown
    assert "http://" not in shown
