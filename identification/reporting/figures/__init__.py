"""Static figures of the report; each function takes data and returns SVG text."""
