"""Restore into an existing, empty directory, such as a mount point."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from app.backup import restore as module
from app.backup.create import back_up
from app.backup.restore import restore
from app.settings import Settings, load_settings
from app.storage import Storage
from identification.errors import InputError, OptionError

PARTS = ["fits", "incoming", "motorid.sqlite3", "nodes", "runs"]


@pytest.fixture
def saved(settings: Settings, tmp_path: Path) -> Path:
    """Backup of the data directory."""
    back_up(settings, tmp_path / "saved.tar")
    return tmp_path / "saved.tar"


@pytest.fixture
def empty(tmp_path: Path) -> Path:
    """Empty directory."""
    made = tmp_path / "there"
    made.mkdir()
    return made


def names(directory: Path) -> list[str]:
    """Names of the entries of a directory."""
    return sorted(path.name for path in directory.iterdir())


def test_empty_directory_is_filled_and_stays_the_same(saved: Path, empty: Path) -> None:
    """A mount point, such as a container volume, cannot be replaced, so its inode remains."""
    before = empty.stat().st_ino

    assert restore(load_settings(data_dir=empty), saved).startswith("2 runs ")

    assert empty.stat().st_ino == before
    assert names(empty) == PARTS


def test_link_to_an_empty_directory_stays_a_link(saved: Path, empty: Path, tmp_path: Path) -> None:
    """The restore fills the directory that the link points to."""
    link = tmp_path / "link"
    link.symlink_to(empty)

    restore(load_settings(data_dir=link), saved)

    assert link.is_symlink()
    assert names(empty) == PARTS
    assert names(tmp_path) == ["data", "link", "saved.tar", "there"]


def test_link_to_nothing_stays_a_link(saved: Path, tmp_path: Path) -> None:
    """The restore creates the directory that the link points to."""
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "there")

    restore(load_settings(data_dir=link), saved)

    assert link.is_symlink()
    assert names(tmp_path / "there") == PARTS


def test_bad_backup_leaves_the_directory_empty(saved: Path, empty: Path) -> None:
    """The directory remains available for another restore."""
    saved.write_bytes(saved.read_bytes()[:5000])

    with pytest.raises(InputError):
        restore(load_settings(data_dir=empty), saved)

    assert names(empty) == []


def test_move_that_fails_leaves_the_directory_empty(
    saved: Path, empty: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The service would serve a partly restored directory."""

    def failing(_: Any) -> None:
        raise OSError(5, "Input/output error")

    def move(partial: Path, place: Path) -> None:
        monkeypatch.setattr(module, "sync", failing)
        original(partial, place)

    original = module._move_up
    monkeypatch.setattr(module, "_move_up", move)

    with pytest.raises(OSError, match="Input/output"):
        restore(load_settings(data_dir=empty), saved)

    assert names(empty) == []


def test_interrupted_restore_is_refused_by_restore_and_service(saved: Path, empty: Path) -> None:
    """A crash during the move leaves some of the entries in the directory."""
    (empty / ".restoring").mkdir()
    for part in ("runs", "fits"):
        (empty / part).mkdir()
    settings = load_settings(data_dir=empty)

    with pytest.raises(OptionError, match="interrupted restore left"):
        restore(settings, saved)
    with pytest.raises(OptionError, match="restore into .* has not come to its end"):
        Storage(empty, "bench").prepare()

    assert names(empty) == [".restoring", "fits", "runs"]


def test_restore_overwrites_no_file_created_meanwhile(
    saved: Path, empty: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A database is created in the target directory while the backup is read."""
    original = module._fill

    def fill(directory: Path, backup: Path) -> Any:
        found = original(directory, backup)
        (empty / "motorid.sqlite3").write_text("mine")
        return found

    monkeypatch.setattr(module, "_fill", fill)

    with pytest.raises(OptionError, match="not empty"):
        restore(load_settings(data_dir=empty), saved)

    assert names(empty) == ["motorid.sqlite3"]
    assert (empty / "motorid.sqlite3").read_text() == "mine"
