"""Pages: what a browser sees, the documentation of the interface included."""
