"""Backups whose database was modified, together with its checksum, are rejected."""

from __future__ import annotations

import hashlib
import sqlite3
from pathlib import Path

import pytest

from app.backup.create import back_up
from app.backup.restore import restore
from app.settings import Settings, load_settings
from identification.errors import InputError

ID = "a" * 26
CHANGES = {
    "run": "UPDATE fit_runs SET run_id = '../../victim'",
    "role": "UPDATE fit_runs SET fit_id = '../../victim' WHERE rowid = 1",
    "failed fit": "UPDATE fits SET id = '../../victim', status = 'failed' WHERE status = 'queued'",
    "bytes": "UPDATE fits SET id = x'2e2e' WHERE status = 'queued'",
    "another kind": f"UPDATE fits SET id = 'run_{ID}' WHERE status = 'queued'",
    "batch of a fit": "UPDATE fits SET batch_id = '..'",
    "batch": "INSERT INTO batches (id, workspace, created_at, request_sha256) "
    "VALUES ('../x', 'a', 0, '')",
    "key": "UPDATE keys SET id = '..'",
    "session": "INSERT INTO sessions VALUES ('', '..', 0)",
    "attempt below 0": "UPDATE fits SET attempt = -1 WHERE status = 'queued'",
    "attempt as a path": "UPDATE fits SET attempt = '../../..' WHERE status = 'queued'",
    "attempt with a fraction": "UPDATE fits SET attempt = 0.5 WHERE status = 'queued'",
    "trigger": "CREATE TRIGGER t AFTER INSERT ON runs BEGIN DELETE FROM keys; END",
    "view": "CREATE VIEW v AS SELECT * FROM keys",
    "table": "CREATE TABLE more (x)",
    "index": "CREATE INDEX strange ON keys (name)",
    "table less": "DROP TABLE sessions",
    "view for a table": "DROP TABLE sessions; CREATE VIEW sessions AS SELECT 1 AS key_id",
}


def tampered(backup: Path, statements: str) -> None:
    """Modify the database of a backup and update its checksum."""
    file, sums = backup / "motorid.sqlite3", backup / "SHA256SUMS"
    old = hashlib.sha256(file.read_bytes()).hexdigest()
    database = sqlite3.connect(file)
    database.executescript(statements)
    database.close()
    new = hashlib.sha256(file.read_bytes()).hexdigest()
    assert new != old
    sums.write_text(sums.read_text().replace(old, new))


@pytest.mark.parametrize("kind", CHANGES)
def test_tampered_database_is_refused(settings: Settings, tmp_path: Path, kind: str) -> None:
    """Invalid IDs would become paths that retention deletes; triggers would alter statements."""
    back_up(settings, tmp_path / "saved")
    tampered(tmp_path / "saved", CHANGES[kind])

    with pytest.raises(InputError, match=r"motorid\.sqlite3 has (a|no|'|-|0|b')"):
        restore(load_settings(data_dir=tmp_path / "there"), tmp_path / "saved")

    assert not list(tmp_path.glob("there*"))


def test_backup_of_an_older_version_is_accepted(settings: Settings, tmp_path: Path) -> None:
    """It lacks an index, which the next start of the service creates."""
    back_up(settings, tmp_path / "saved")
    tampered(tmp_path / "saved", "DROP INDEX ix_fits_motor")

    restored = restore(load_settings(data_dir=tmp_path / "there"), tmp_path / "saved")

    assert restored.startswith("2 runs ")
