"""What the data leave uncertain: the posterior density and its sampling."""
