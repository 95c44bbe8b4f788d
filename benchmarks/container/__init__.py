"""Build, run and test of the container image without a container engine."""
