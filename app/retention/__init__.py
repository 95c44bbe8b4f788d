"""Retention: deletes expired data that nothing refers to, with the files that belong to it."""
