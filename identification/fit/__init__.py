"""Output-error estimation: starting values, Gauss-Newton fit, noise model, identifiability."""
