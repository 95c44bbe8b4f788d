"""Model selection: score tests, refits, acceptance criteria, search and alternatives."""
