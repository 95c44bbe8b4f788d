"""Two doors to the library: the command line and the HTTP service."""
