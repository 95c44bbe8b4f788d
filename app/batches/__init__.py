"""Batches: one request for many motors, with one fit each."""
