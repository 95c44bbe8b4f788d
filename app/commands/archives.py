"""The commands `backup` and `restore`; `app.commands.administration` does the work."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.commands import options

__all__ = ["backup", "restore"]


def backup(
    archive: options.NewBackup,
    data_dir: options.DataDir = None,
) -> None:
    """Back up the service's database, runs and results, even while the service runs."""
    from app.commands import administration

    administration.back_up(archive, data_dir)


def restore(
    archive: Annotated[
        Path, typer.Argument(metavar="BACKUP", help="Backup made by 'motorid backup'.")
    ],
    data_dir: options.DataDir = None,
) -> None:
    """Create a data directory from a backup after checking every file; nothing is overwritten."""
    from app.commands import administration

    administration.restore(archive, data_dir)
