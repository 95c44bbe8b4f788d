"""`motorid batch`: identification of many motors from a manifest, locally or on a service."""
