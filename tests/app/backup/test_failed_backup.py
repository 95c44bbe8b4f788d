"""A failed or killed backup leaves no files and can be repeated."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from app.backup import archive
from app.backup.create import back_up
from app.settings import Settings
from app.storage import Storage
from identification.errors import InputError

PLACES = ("saved", "saved.tar")
KILLED = """
import os, signal, sys
from pathlib import Path
from app.storage import Storage
with Storage(Path(sys.argv[1]), "other").scratch() as folder:
    (folder / "motorid.sqlite3").write_bytes(b"half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def contents(directory: Path) -> set[str]:
    """Paths of all entries below a directory."""
    return {path.relative_to(directory).as_posix() for path in directory.rglob("*")}


@pytest.mark.parametrize("place", PLACES)
def test_backup_of_a_changed_run_fails(settings: Settings, tmp_path: Path, place: str) -> None:
    """A defective disk is reported by the backup, not when the backup is needed."""
    run = next((settings.data_dir / "runs").iterdir())
    good = run.read_bytes()
    run.write_bytes(b"other")
    before = contents(tmp_path)

    with pytest.raises(InputError, match="SHA-256 has changed"):
        back_up(settings, tmp_path / place)

    assert contents(tmp_path) == before
    run.write_bytes(good)
    assert back_up(settings, tmp_path / place).startswith("2 runs ")


@pytest.mark.parametrize("place", PLACES)
def test_backup_of_a_missing_run_fails(settings: Settings, tmp_path: Path, place: str) -> None:
    """The row still exists, so no client has deleted the run."""
    next((settings.data_dir / "runs").iterdir()).unlink()
    before = contents(tmp_path)

    with pytest.raises(InputError, match="is gone, and the database still has"):
        back_up(settings, tmp_path / place)

    assert contents(tmp_path) == before


@pytest.mark.parametrize("place", PLACES)
def test_full_disk_leaves_no_part_of_a_backup(
    settings: Settings, tmp_path: Path, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A partial backup would occupy the space that the user must free."""
    before = contents(tmp_path)
    calls: list[object] = []

    def full(*_: Any) -> Any:
        calls.append(None)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(archive, "sync", full)
        with pytest.raises(OSError, match="No space left"):
            back_up(settings, tmp_path / place)

    assert calls
    assert contents(tmp_path) == before
    assert back_up(settings, tmp_path / place).startswith("2 runs ")


def test_existing_target_directory_remains(settings: Settings, tmp_path: Path) -> None:
    """A failed backup leaves the existing directory empty."""
    place = tmp_path / "saved"
    place.mkdir()
    next((settings.data_dir / "runs").iterdir()).unlink()

    with pytest.raises(InputError, match="is gone"):
        back_up(settings, place)

    assert list(place.iterdir()) == []


def test_database_copy_of_a_killed_backup_is_swept(tmp_path: Path) -> None:
    """A younger copy remains, because its backup may not have locked it yet."""
    storage = Storage(tmp_path, "bench")
    storage.prepare()
    killed = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)])
    assert killed.returncode == -signal.SIGKILL
    [left] = (tmp_path / "incoming").glob(".backup-*")

    assert storage.sweep(set(), set(), time.time()) == 0
    assert left.is_dir()
    assert storage.sweep(set(), set(), time.time() + 3700) == 1
    assert not left.exists()
    assert storage.incoming.is_dir()


def test_database_copy_of_a_running_backup_is_never_swept(tmp_path: Path) -> None:
    """The lock of the backup process protects the copy, however old it is."""
    storage = Storage(tmp_path, "bench")
    storage.prepare()

    with storage.scratch() as folder:
        assert storage.sweep(set(), set(), time.time() + 86400) == 0
        assert folder.is_dir()

    assert not folder.exists()


def test_machine_called_backup_keeps_its_uploads(tmp_path: Path) -> None:
    """A host name cannot give an upload directory the name of a backup directory."""
    storage = Storage(tmp_path, ".backup-1")
    storage.prepare()

    storage.sweep(set(), set(), time.time() + 86400)

    assert storage.incoming.is_dir()
