"""Stress tests of the service: hostile files, clients, networks and machines."""
