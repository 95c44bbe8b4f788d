"""Fleet comparison: results table, parameter drift since the last refit, and outlying motors."""
