"""Benchmarks: `python -m tests.bench` runs them and writes what it measured to tests/bench/results/."""
