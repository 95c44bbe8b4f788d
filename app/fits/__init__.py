"""Fits: accepted, queued, computed in processes of their own, watched and cancelled."""
