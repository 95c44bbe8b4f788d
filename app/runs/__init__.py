"""Runs: upload, parsing in a process with resource limits, storage and listing."""
