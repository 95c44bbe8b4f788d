"""Many motors from a manifest: fitted on this machine, or by a service."""
