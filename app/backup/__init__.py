"""Backup and restore: the database and the files that belong to it, as one, checked by hash."""
