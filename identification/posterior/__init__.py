"""Bayesian posterior of a fitted model: density, ensemble MCMC and importance sampling."""
