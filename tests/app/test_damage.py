"""A damaged database: found at the start, named, and answered with a code when found later."""

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
    """A data directory with a hundred runs in the database and the file of one."""
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
    """Put bytes into a file that no page of a database begins with."""
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
def test_damaged_database_is_named_with_the_way_back(
    data: Path,
    damage: str,
    command: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One line with the file and the command that restores; the directory is as it was."""
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
def test_keys_of_a_damaged_database_are_refused_in_one_line(
    data: Path, damage: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A new database would have no keys, and the next start would find it sound."""
    DAMAGES[damage](data / DATABASE)

    assert main(["keys", "list", "--data-dir", str(data)]) == 1
    shown = capsys.readouterr().err
    assert shown.count("\n") == 1
    assert f"{data / DATABASE}: is " in shown


def test_sound_or_new_database_has_no_damage(data: Path) -> None:
    """Neither a file that is there and sound nor one that is to be made."""
    check_file(data / DATABASE)
    check_file(data / "none")


def test_damage_that_is_found_later_is_a_problem_and_no_readiness(tmp_path: Path) -> None:
    """JSON that is none in one row; the rest is answered, and the service lives."""
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


def test_page_that_is_overwritten_while_the_service_runs_is_a_problem(tmp_path: Path) -> None:
    """Every page but the first: the gate asks for the key, and finds the damage itself."""
    data = tmp_path / "data"
    key = make_key(data)
    with serving(data) as server:
        headers = {"Authorization": f"Bearer {key}"}
        file = data / DATABASE
        overwrite(file, 4096, file.stat().st_size - 4096)
        # SQLite keeps pages until the counter in the first one says that they changed.
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


def test_address_is_shown_by_the_server_that_has_the_directory(
    data: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever reads an address takes it that somebody is going to answer there."""
    monkeypatch.setattr("app.server.configure_logging", lambda level: None)
    first = Storage(data, load_settings(data_dir=data).node)
    first.lock.take()

    status = main(["serve", "--port", "0", "--no-auth", "--data-dir", str(data)])

    first.lock.release()
    shown = capsys.readouterr().err
    assert status == 2
    assert "another server already uses" in shown
    assert "http://" not in shown
