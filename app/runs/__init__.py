"""Runs: uploads taken in, read in a process with limits, kept and listed."""
