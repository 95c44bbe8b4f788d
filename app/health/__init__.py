"""Health of the service: liveness, readiness and metrics."""
