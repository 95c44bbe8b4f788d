"""Data directory for the backup tests."""

from __future__ import annotations

import hashlib
import time
from pathlib import Path

import pytest

from app.access.service import AccessService
from app.database import Database
from app.settings import Settings, load_settings
from app.storage import Storage
from tests.app.rows import fit_row, role_row, run_row


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    """Data directory with two runs, a result, a waiting fit, a key and a session."""
    made = load_settings(data_dir=tmp_path / "data")
    storage = Storage(made.data_dir, made.node)
    storage.prepare()
    database = Database(made.sqlalchemy_url)
    database.migrate()
    access = AccessService(database)
    access.open_session(access.create_key("bench")[1], 60.0)
    runs = [run_row("a"), run_row("b")]
    fits = [fit_row("a", "succeeded", ended_at=time.time()), fit_row("a", "queued")]
    for run in runs:
        content = run.id.encode() * 1000
        run.sha256 = hashlib.sha256(content).hexdigest()
        storage.run(run.id).write_bytes(content)
    result = storage.attempt(fits[0].id, 1)
    result.mkdir(parents=True)
    for name in ("result.json", "report.html", "worker.log"):
        (result / name).write_text(name)
    with database.writing() as session:
        session.add_all([*runs, *fits])
        session.flush()
        session.add_all(role_row(fit, runs[0]) for fit in fits)
    database.close()
    return made
