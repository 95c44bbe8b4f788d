"""Alembic environment: apply the migrations on the connection supplied by `app.database`."""

from __future__ import annotations

from alembic import context

from app.tables import Tables

_connection = context.config.attributes["connection"]
context.configure(connection=_connection, target_metadata=Tables.metadata, render_as_batch=True)
context.run_migrations()
