"""The container image without a container engine: built, run as an engine runs it, and checked."""
