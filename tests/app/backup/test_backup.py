"""Backup and restore: a restore reproduces the data, and a modified backup is rejected."""

from __future__ import annotations

import hashlib
import sqlite3
import subprocess
import tarfile
from pathlib import Path

import pytest

from app.backup.archive import is_name
from app.backup.create import back_up
from app.backup.restore import restore
from app.settings import Settings, load_settings
from identification.errors import InputError, OptionError

PLACES = ("saved", "saved.tar")


def files(directory: Path) -> dict[str, bytes]:
    """Content of each file of runs and results by name."""
    return {
        path.relative_to(directory).as_posix(): path.read_bytes()
        for part in ("runs", "fits")
        for path in (directory / part).rglob("*")
        if path.is_file()
    }


def rows(directory: Path) -> dict[str, list[object]]:
    """Content of each table."""
    with sqlite3.connect(directory / "motorid.sqlite3") as database:
        return {
            table: sorted(database.execute(f"SELECT * FROM {table}"), key=repr)
            for table in ("keys", "sessions", "runs", "fits", "fit_runs", "batches")
        }


@pytest.mark.parametrize("place", PLACES)
def test_restore_reproduces_the_data(settings: Settings, tmp_path: Path, place: str) -> None:
    """All rows except browser sessions, all runs and all outputs are restored; logs are not."""
    there = load_settings(data_dir=tmp_path / "there")

    saved = back_up(settings, tmp_path / place)
    restored = restore(there, tmp_path / place)

    assert saved == restored == "2 runs and 1 results in 5 files"
    expected = files(settings.data_dir)
    assert files(there.data_dir) == {n: c for n, c in expected.items() if "worker.log" not in n}
    assert rows(there.data_dir) == rows(settings.data_dir) | {"sessions": []}
    assert there.data_dir.stat().st_mode & 0o077 == 0


def test_checksums_pass_sha256sum(settings: Settings, tmp_path: Path) -> None:
    """GNU coreutils can verify the checksum file."""
    back_up(settings, tmp_path / "saved")

    checked = subprocess.run(
        ["sha256sum", "--check", "--strict", "--quiet", "SHA256SUMS"], cwd=tmp_path / "saved"
    )

    assert checked.returncode == 0


@pytest.mark.parametrize("place", PLACES)
def test_backup_overwrites_nothing(settings: Settings, tmp_path: Path, place: str) -> None:
    """A backup to an existing target is rejected."""
    back_up(settings, tmp_path / place)

    with pytest.raises(OptionError, match="there already.*overwrites nothing"):
        back_up(settings, tmp_path / place)


def test_restore_overwrites_nothing(settings: Settings, tmp_path: Path) -> None:
    """A restore to a data directory in use is rejected and leaves it unchanged."""
    back_up(settings, tmp_path / "saved.tar")
    before = files(settings.data_dir)

    with pytest.raises(OptionError, match="not empty.*overwrites nothing"):
        restore(settings, tmp_path / "saved.tar")

    assert files(settings.data_dir) == before


def changed(folder: Path, kind: str) -> None:
    """Apply a change to a copy of a backup."""
    run = next((folder / "runs").iterdir())
    if kind == "a bit":
        run.write_bytes(run.read_bytes()[:-1] + b"\x00")
    elif kind == "a file less":
        run.unlink()
    elif kind == "a file more":
        (folder / "runs" / ("run_" + "a" * 26)).write_text("")
    elif kind == "interrupted":
        (folder / "SHA256SUMS").unlink()
    elif kind == "another name":
        (folder / "evil.txt").write_text("")
    elif kind == "a link":
        run.unlink()
        run.symlink_to("/etc/passwd")
    elif kind == "broken sums":
        (folder / "SHA256SUMS").write_text("x\n")
    elif kind == "broken database":
        file = folder / "motorid.sqlite3"
        old = hashlib.sha256(file.read_bytes()).hexdigest()
        file.write_bytes(file.read_bytes()[:5000])
        new = hashlib.sha256(file.read_bytes()).hexdigest()
        sums = folder / "SHA256SUMS"
        sums.write_text(sums.read_text().replace(old, new))


@pytest.mark.parametrize(
    "kind",
    [
        "a bit",
        "a file less",
        "a file more",
        "interrupted",
        "another name",
        "a link",
        "broken sums",
        "broken database",
    ],
)
def test_modified_backup_is_refused(settings: Settings, tmp_path: Path, kind: str) -> None:
    """The failed restore leaves no file at the target."""
    back_up(settings, tmp_path / "saved")
    changed(tmp_path / "saved", kind)
    there = load_settings(data_dir=tmp_path / "there")

    with pytest.raises(InputError, match="saved"):
        restore(there, tmp_path / "saved")

    assert not list(tmp_path.glob("there*"))


def test_truncated_tar_is_refused(settings: Settings, tmp_path: Path) -> None:
    """The archive is truncated to half its length."""
    file = tmp_path / "saved.tar"
    back_up(settings, file)
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])

    with pytest.raises(InputError, match=r"saved\.tar"):
        restore(load_settings(data_dir=tmp_path / "there"), file)


@pytest.mark.parametrize("name", ["../evil", "/etc/evil", "runs/../../evil"])
def test_tar_cannot_write_elsewhere(tmp_path: Path, name: str) -> None:
    """Only member names of the backup format are extracted, so no path leaves the target."""
    with tarfile.open(tmp_path / "bad.tar", "w") as tar:
        tar.addfile(tarfile.TarInfo(name))

    with pytest.raises(InputError, match="does not belong in a backup"):
        restore(load_settings(data_dir=tmp_path / "there"), tmp_path / "bad.tar")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.tar"]


def test_sparse_member_is_refused_before_it_is_written(tmp_path: Path) -> None:
    """A sparse member of 400 MB in a file of 10 kB would fill the disk."""
    member = tarfile.TarInfo("motorid.sqlite3")
    member.size = 0
    member.pax_headers = {"GNU.sparse.size": "400000000", "GNU.sparse.map": "0,0"}
    with tarfile.open(tmp_path / "sparse.tar", "w", format=tarfile.PAX_FORMAT) as tar:
        tar.addfile(member)

    with pytest.raises(InputError, match="no ordinary file"):
        restore(load_settings(data_dir=tmp_path / "there"), tmp_path / "sparse.tar")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sparse.tar"]


def test_postgresql_is_left_to_pg_dump(tmp_path: Path) -> None:
    """The error message names pg_dump."""
    settings = load_settings(data_dir=tmp_path, database_url="postgresql://host/base")

    with pytest.raises(OptionError, match="pg_dump"):
        back_up(settings, tmp_path / "saved")
    with pytest.raises(OptionError, match="pg_dump"):
        restore(settings, tmp_path / "saved")


def test_directory_without_a_database_is_refused(tmp_path: Path) -> None:
    """A misspelt data directory must not give an empty backup."""
    with pytest.raises(OptionError, match=r"no motorid\.sqlite3"):
        back_up(load_settings(data_dir=tmp_path), tmp_path / "saved")


@pytest.mark.parametrize(
    "name",
    ["", "x", "runs/x", "fits/x/1/result.json", "runs/run_" + "a" * 26 + "/x", "SHA256SUMS/x",
     "fits/fit_" + "a" * 26 + "/1/..", "fits/fit_" + "a" * 26 + "/../result.json"],
)  # fmt: skip
def test_names_outside_the_backup_format_are_invalid(name: str) -> None:
    """A valid name consists of IDs, attempt numbers and names of outputs."""
    assert not is_name(name)
