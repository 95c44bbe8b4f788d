"""Batches: many motors at once, each a fit of its own."""
