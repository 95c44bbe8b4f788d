"""Whether the model lacks something, in which equation, and against which signal it shows."""
