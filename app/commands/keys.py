"""The commands `keys create`, `keys list` and `keys revoke`."""

from __future__ import annotations

from typing import Annotated

import typer

from app.commands import options

__all__ = ["keys"]

keys = typer.Typer(help="API keys of the HTTP service.", rich_markup_mode=None)


@keys.command("create")
def create_key(
    name: Annotated[str, typer.Argument(help="Display name, such as the name of the test bench.")],
    workspace: Annotated[
        str, typer.Option(help="Workspace whose runs and fits the key gives access to.")
    ] = "default",
    days: Annotated[
        float | None, typer.Option(help="Lifetime in days.  [default: unlimited]")
    ] = None,
    owner: Annotated[
        bool, typer.Option(help="Whether the key manages the keys of its workspace on /keys.")
    ] = True,
    data_dir: options.DataDir = None,
) -> None:
    """Create an API key.  It is printed once and cannot be shown again."""
    from app.commands import administration

    administration.create_key(name, workspace, days, data_dir, owner=owner)


@keys.command("list")
def list_keys(data_dir: options.DataDir = None) -> None:
    """List all keys with workspace, expiry and last use, but not their secrets."""
    from app.commands import administration

    administration.list_keys(data_dir)


@keys.command("revoke")
def revoke_key(
    key: Annotated[str, typer.Argument(help="Id of the key, from 'motorid keys list'.")],
    data_dir: options.DataDir = None,
) -> None:
    """Revoke a key and end its sessions."""
    from app.commands import administration

    administration.revoke_key(key, data_dir)
