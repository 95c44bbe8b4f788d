"""Preview of runs before a fit: what was read, what it excites, what it can identify."""

from identification.preview.preview import Preview, examine, preview

__all__ = ["Preview", "examine", "preview"]
