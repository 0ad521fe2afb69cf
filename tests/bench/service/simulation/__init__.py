"""A farm without nodes: the service's own dispatcher and store, workers that are played, and a clock that jumps.

python -m tests.bench.service.simulation [--nodes 1000] [--tenants 100] [--frames 1000000] [--minutes 15] [--database sqlite]
"""
