"""Campaigns as benches record them: a simulator of its own, its cases and the measurement."""
