"""The service under what benches, networks and machines do to it."""
