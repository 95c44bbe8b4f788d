"""The motor in symbols, and its simulation."""
