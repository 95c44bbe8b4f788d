"""Backup and restore of the database with its files, verified by hash."""
