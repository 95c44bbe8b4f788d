"""Measurements of speed and of statistical truth; not part of the product."""
