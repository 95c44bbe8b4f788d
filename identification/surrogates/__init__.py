"""Surrogate terms: splines, ripple, friction states and backlash, for effects without a law."""
