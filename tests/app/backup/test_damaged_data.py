"""A backup of a data directory whose disk has damaged something, and a backup that lacks a file."""

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
    """The directory of the outputs, sealed as those of a fit are."""
    found = next(settings.data_dir.glob("fits/*/1"))
    seal(found)
    return found


@pytest.mark.parametrize("place", ["saved", "saved.tar"])
@pytest.mark.parametrize("name", ["result.json", "report.html"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_output_is_found_when_the_backup_is_made(
    settings: Settings, tmp_path: Path, name: str, damage: str, place: str
) -> None:
    """It is named, and nothing of the backup is left."""
    path = attempt(settings) / name
    DAMAGES[damage](path)

    with pytest.raises(InputError, match="backup|deleted over HTTP") as caught:
        back_up(settings, tmp_path / place)

    assert caught.value.file == str(path)
    assert not (tmp_path / place).exists()


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_run_is_found_when_the_backup_is_made(
    settings: Settings, tmp_path: Path, damage: str
) -> None:
    """It is named, with what brings it back."""
    path = next((settings.data_dir / "runs").iterdir())
    DAMAGES[damage](path)

    with pytest.raises(InputError, match="the same file") as caught:
        back_up(settings, tmp_path / "saved.tar")

    assert caught.value.file == str(path)


def test_damaged_database_is_found_when_the_backup_is_made(
    settings: Settings, tmp_path: Path
) -> None:
    """SQLite copies pages whatever is on them."""
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
    """Also where it lacks the file in its own sums, as after someone took it out of both."""
    (attempt(settings) / "posterior.nc").write_bytes(b"CDF")
    attempt(settings)
    saved = tmp_path / "saved"
    back_up(settings, saved)
    next(saved.glob(f"fits/*/1/{output}")).unlink()
    sums = (saved / "SHA256SUMS").read_text().splitlines(keepends=True)
    (saved / "SHA256SUMS").write_text("".join(line for line in sums if output not in line))

    with pytest.raises(InputError, match=f"{output} is not what the database says"):
        restore(load_settings(data_dir=tmp_path / "there"), saved)


def test_volume_with_lost_and_found_is_empty(settings: Settings, tmp_path: Path) -> None:
    """The root of an ext4 file system has that directory from its first day."""
    back_up(settings, tmp_path / "saved.tar")
    (tmp_path / "volume" / "lost+found").mkdir(parents=True)

    restore(load_settings(data_dir=tmp_path / "volume"), tmp_path / "saved.tar")

    assert (tmp_path / "volume" / "motorid.sqlite3").is_file()
    assert (tmp_path / "volume" / "lost+found").is_dir()
