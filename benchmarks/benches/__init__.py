"""Realistic test bench recordings: an independent simulator, its cases and the measurement."""
