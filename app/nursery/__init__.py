"""Processes for risky and long work, forked from one that has loaded everything already."""
