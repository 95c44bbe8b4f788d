"""Output files of a fit: result.json, the HTML report and the posterior as NetCDF."""
