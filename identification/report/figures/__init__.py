"""Static pictures of the report; each function takes data and returns the text of a drawing."""
