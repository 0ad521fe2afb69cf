"""Executors run the chunks of jobs: base.py is the interface for the dispatcher, by_name.py chooses one, local.py runs
processes on this machine."""
