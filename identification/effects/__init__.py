"""What real motors have beyond the declared model: the catalogue and the search."""
