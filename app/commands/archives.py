"""The commands `backup` and `restore`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from app.commands import options

__all__ = ["backup", "restore"]


def backup(archive: options.NewBackup, data_dir: options.DataDir = None) -> None:
    """Back up the service's database, runs and results, even while the service runs."""
    from app.backup.create import back_up
    from app.commands.administration import owner_only
    from app.settings import load_settings

    with owner_only():
        saved = back_up(load_settings(data_dir=data_dir), archive)
    text = f"{saved.runs} runs and {saved.fits} results in {saved.files} files"
    print(f"motorid: {archive} contains {text} and their SHA-256", file=sys.stderr)  # noqa: T201


def restore(
    archive: Annotated[
        Path, typer.Argument(metavar="BACKUP", help="Backup made by 'motorid backup'.")
    ],
    data_dir: options.DataDir = None,
) -> None:
    """Create a data directory from a backup after checking every file; nothing is overwritten."""
    from app.backup.restore import restore as write
    from app.commands.administration import owner_only
    from app.settings import load_settings

    settings = load_settings(data_dir=data_dir)
    with owner_only():
        saved = write(settings, archive)
    text = f"{saved.runs} runs and {saved.fits} results in {saved.files} files"
    print(f"motorid: {settings.data_dir} contains {text}, all verified", file=sys.stderr)  # noqa: T201
