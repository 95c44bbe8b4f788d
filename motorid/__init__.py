"""What a script needs to use the service from outside: see `motorid.client`."""
