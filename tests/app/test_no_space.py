"""Full disks: a command ends with status 1 and one line, which never contains SQL."""

from __future__ import annotations

import errno
import os
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy.exc import IntegrityError, OperationalError

from app.access.service import AccessService
from app.backup import archive
from app.backup import restore as restoring
from app.cli import main
from app.database import Database
from app.disk import is_full
from app.settings import load_settings
from app.storage import Storage
from identification.errors import OptionError

DIGEST = "0123456789abcdef" * 4
SQL = "INSERT INTO keys (digest) VALUES (?)"


def full_sqlite() -> sqlite3.OperationalError:
    """SQLite's error for a full disk, provoked by a limit of one page."""
    with sqlite3.connect(":memory:") as database:
        database.execute("PRAGMA max_page_count=1")
        with pytest.raises(sqlite3.OperationalError, match="disk is full") as caught:
            database.execute("CREATE TABLE t (x)")
    return caught.value


def raising(error: BaseException) -> Any:
    """Function that raises an error, whatever its arguments."""

    def function(*_: object, **__: object) -> None:
        raise error

    return function


def no_space() -> OSError:
    """The operating system's error for a full disk."""
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.fixture
def data(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """Data directory with a key."""
    assert main(["keys", "create", "bench", "--data-dir", str(tmp_path / "data")]) == 0
    capsys.readouterr()
    return tmp_path / "data"


def refusal(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Error line of a command that ends with status 1."""
    assert main(words) == 1
    [line] = capsys.readouterr().err.splitlines()
    assert "internal error" not in line
    return line


def test_key_creation_on_a_full_disk_shows_no_hash(
    data: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The message contains neither the SQL statement nor its parameters."""
    error = OperationalError(SQL, (DIGEST,), full_sqlite())
    monkeypatch.setattr(AccessService, "create_key", raising(error))

    line = refusal(["keys", "create", "b", "--data-dir", str(data)], capsys)

    assert "no space is left on the device of the database" in line
    assert "INSERT" not in line
    assert DIGEST not in line


def test_migration_on_a_full_disk_reports_the_disk(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The message does not blame the option with the database URL."""
    error = OperationalError(SQL, (), full_sqlite())
    monkeypatch.setattr(Database, "_upgrade", raising(error))

    line = refusal(["keys", "create", "b", "--data-dir", str(tmp_path / "new")], capsys)

    assert "no space is left" in line


@pytest.mark.parametrize("error", [no_space(), full_sqlite()])
@pytest.mark.parametrize("place", ["saved", "saved.tar"])
def test_backup_on_a_full_disk_reports_the_disk(
    data: Path,
    tmp_path: Path,
    place: str,
    error: Exception,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The database copy may fail in SQLite or in the file system; no partial backup remains."""
    monkeypatch.setattr("app.backup.create._copy_of", raising(error))

    line = refusal(["backup", str(tmp_path / place), "--data-dir", str(data)], capsys)

    assert "no space is left" in line
    assert not (tmp_path / place).exists()


@pytest.mark.parametrize("kind", ["_Tar", "_Folder"])
def test_backup_target_on_a_full_disk_reports_the_disk(
    kind: str,
    data: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not even the first entry of the target can be created."""
    monkeypatch.setattr(archive, kind, raising(no_space()))
    place = tmp_path / ("saved.tar" if kind == "_Tar" else "saved")

    assert "no space is left" in refusal(["backup", str(place), "--data-dir", str(data)], capsys)


@pytest.mark.parametrize("place", ["saved", "saved.tar"])
@pytest.mark.parametrize("is_there", [True, False])
def test_restore_to_a_full_disk_does_not_blame_the_backup(
    data: Path,
    tmp_path: Path,
    place: str,
    is_there: bool,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The restored files are removed."""
    main(["backup", str(tmp_path / place), "--data-dir", str(data)])
    capsys.readouterr()
    there = tmp_path / "there"
    if is_there:
        there.mkdir()
    monkeypatch.setattr(restoring, "stored", raising(no_space()))

    line = refusal(["restore", str(tmp_path / place), "--data-dir", str(there)], capsys)

    assert "no space is left" in line
    assert "cannot be read" not in line
    assert [p.name for p in tmp_path.glob("there*")] == (["there"] if is_there else [])
    assert not is_there or list(there.iterdir()) == []


def test_data_directory_on_a_full_disk_reports_the_disk(
    data: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The message gives the cause of the option error, which is the disk."""

    def prepare(_: Storage) -> None:
        raise OptionError("data_dir: cannot be used") from no_space()

    monkeypatch.setattr(Storage, "prepare", prepare)

    assert "no space is left" in refusal(["keys", "list", "--data-dir", str(data)], capsys)


def test_no_database_error_shows_sql(
    data: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """PostgreSQL gives the values in a second line, which is not shown."""
    reason = RuntimeError(f"a value is there already\nDETAIL: Key (digest)=({DIGEST})")
    error = IntegrityError(SQL, (DIGEST,), reason)
    monkeypatch.setattr(AccessService, "create_key", raising(error))

    assert main(["keys", "create", "b", "--data-dir", str(data)]) == 1

    shown = capsys.readouterr().err
    assert "IntegrityError: a value is there already (please report it" in shown
    assert "INSERT" not in shown
    assert DIGEST not in shown


def test_database_errors_contain_no_parameters(tmp_path: Path) -> None:
    """Errors are logged, and the parameters include hashes of keys."""
    database = Database(load_settings(data_dir=tmp_path).sqlalchemy_url)
    access = AccessService(database)

    with pytest.raises(OperationalError) as caught:
        access.create_key("a name that nobody else has")
    database.close()

    assert "no such table" in str(caught.value)
    assert "a name that nobody else has" not in str(caught.value)


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (OSError(errno.ENOSPC, ""), True),
        (OSError(errno.EDQUOT, ""), True),
        (OSError(errno.EACCES, ""), False),
        (full_sqlite(), True),
        (OperationalError(SQL, (), full_sqlite()), True),
        (OperationalError(SQL, (), sqlite3.OperationalError("locked")), False),
        (RuntimeError("disk is full"), False),
    ],
)
def test_full_disk_is_recognised_by_error_code(error: Exception, expected: bool) -> None:
    """The text of an error may be in any language."""
    assert is_full(error) == expected
