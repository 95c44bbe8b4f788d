"""Measurements of speed, coverage and identification rates; not part of the product."""
