"""Comparison with other programs on the same data, noise and stopping rule; `make peers`.

Every measurement runs in its own process, motorid in the environment of the project, each peer in
`.venv-peers` from `requirements/peers.txt`.  The modules of the peers import nothing of the
project but `benchmarks.handwritten` and this package.
"""
