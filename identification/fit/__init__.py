"""Estimation: starting values, least squares on the simulation error, noise, identifiability."""
