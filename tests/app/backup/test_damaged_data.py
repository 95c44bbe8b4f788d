"""Backups of damaged data directories, and incomplete backups."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.backup.create import back_up
from app.backup.restore import restore
from app.damage import DamagedDatabase
from app.fits.outputs import seal
from app.settings import Settings, load_settings
from identification.errors import InputError
from tests.app.damaged import DAMAGES


def attempt(settings: Settings) -> Path:
    """Directory of sealed outputs."""
    found = next(settings.data_dir.glob("fits/*/1"))
    seal(found)
    return found


@pytest.mark.parametrize("place", ["saved", "saved.tar"])
@pytest.mark.parametrize("name", ["result.json", "report.html"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_backup_detects_a_damaged_output(
    settings: Settings, tmp_path: Path, name: str, damage: str, place: str
) -> None:
    """The error names the output, and no part of the backup remains."""
    path = attempt(settings) / name
    DAMAGES[damage](path)

    with pytest.raises(InputError, match="backup|deleted over HTTP") as caught:
        back_up(settings, tmp_path / place)

    assert caught.value.file == str(path)
    assert not (tmp_path / place).exists()


@pytest.mark.parametrize("damage", DAMAGES)
def test_backup_detects_a_damaged_run(settings: Settings, tmp_path: Path, damage: str) -> None:
    """The error names the run and the remedy."""
    path = next((settings.data_dir / "runs").iterdir())
    DAMAGES[damage](path)

    with pytest.raises(InputError, match="the same file") as caught:
        back_up(settings, tmp_path / "saved.tar")

    assert caught.value.file == str(path)


def test_backup_detects_a_damaged_database(settings: Settings, tmp_path: Path) -> None:
    """The backup API of SQLite copies damaged pages without an error."""
    with (settings.data_dir / "motorid.sqlite3").open("r+b") as file:
        file.seek(40960)
        file.write(b"\xa5" * 8192)

    with pytest.raises(DamagedDatabase, match=r"motorid\.sqlite3: is damaged"):
        back_up(settings, tmp_path / "saved.tar")

    assert not (tmp_path / "saved.tar").exists()


@pytest.mark.parametrize("output", ["result.json", "report.html", "posterior.nc"])
def test_backup_that_lacks_an_output_is_refused(
    settings: Settings, tmp_path: Path, output: str
) -> None:
    """The output is required even if it was removed from the checksum file as well."""
    (attempt(settings) / "posterior.nc").write_bytes(b"CDF")
    attempt(settings)
    saved = tmp_path / "saved"
    back_up(settings, saved)
    next(saved.glob(f"fits/*/1/{output}")).unlink()
    sums = (saved / "SHA256SUMS").read_text().splitlines(keepends=True)
    (saved / "SHA256SUMS").write_text("".join(line for line in sums if output not in line))

    with pytest.raises(InputError, match=f"{output} is not what the database says"):
        restore(load_settings(data_dir=tmp_path / "there"), saved)


def test_directory_with_lost_and_found_counts_as_empty(settings: Settings, tmp_path: Path) -> None:
    """A new ext4 file system contains the directory lost+found."""
    back_up(settings, tmp_path / "saved.tar")
    (tmp_path / "volume" / "lost+found").mkdir(parents=True)

    restore(load_settings(data_dir=tmp_path / "volume"), tmp_path / "saved.tar")

    assert (tmp_path / "volume" / "motorid.sqlite3").is_file()
    assert (tmp_path / "volume" / "lost+found").is_dir()
