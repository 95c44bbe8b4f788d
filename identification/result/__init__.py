"""Content of result.json, the posterior file, and the plain data that a report draws."""
