"""Calibration of intervals and probabilities on simulated campaigns."""
