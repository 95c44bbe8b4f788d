"""Physical laws of the effects that a motor may have beyond the nominal model."""
