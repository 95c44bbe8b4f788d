"""Residual analysis: detection of missing physics and its localisation in one equation."""
