"""Web pages of the service, including the documentation of its HTTP interface."""
