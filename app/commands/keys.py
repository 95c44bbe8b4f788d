"""The commands `keys create`, `keys list` and `keys revoke`."""

from __future__ import annotations

import sys
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
    from app.commands.administration import date, open_access

    with open_access(data_dir) as access:
        key, secret = access.create_key(name, workspace, days=days, owner=owner)
    print(secret)  # noqa: T201
    until = "" if key.expires_at is None else f" until {date(key.expires_at)}"
    print(  # noqa: T201
        f"motorid: created {key.id} for the workspace {workspace}{until}; the secret is not "
        "shown again",
        file=sys.stderr,
    )


@keys.command("list")
def list_keys(data_dir: options.DataDir = None) -> None:
    """List all keys with workspace, expiry and last use, but not their secrets."""
    from app.commands.administration import date, open_access

    with open_access(data_dir) as access:
        rows = access.list_keys()
    dates = ("created", "revoked", "expires", "last_used")
    print("id", "workspace", "name", *dates, "owner", sep="\t")  # noqa: T201
    for row in rows:
        moments = (getattr(row, f"{name}_at") for name in dates)
        shown = ("" if moment is None else date(moment) for moment in moments)
        print(row.id, row.workspace, row.name, *shown, "yes" if row.owner else "no", sep="\t")  # noqa: T201


@keys.command("revoke")
def revoke_key(
    key: Annotated[str, typer.Argument(help="Id of the key, from 'motorid keys list'.")],
    data_dir: options.DataDir = None,
) -> None:
    """Revoke a key and end its sessions."""
    from app.commands.administration import open_access

    with open_access(data_dir) as access:
        access.revoke_key(key)
