"""Analyses of succeeded fits: other controllers and temperatures, history, comparison."""
