"""Preview of runs before a fit: what was read, what it excites, what it can identify."""

from identification.preview.preview import Preview, check, examine

__all__ = ["Preview", "check", "examine"]
