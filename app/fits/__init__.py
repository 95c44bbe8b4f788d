"""Fits: submission, queue, computation in separate processes, monitoring and cancellation."""
