"""Client of the service for scripts: see `motorid.client`."""
