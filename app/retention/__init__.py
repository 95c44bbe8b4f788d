"""Retention: what is old and needed by nothing is removed, with the files that belong to it."""
