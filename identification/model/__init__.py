"""Symbolic motor model and its simulation."""
