"""Executors run the chunks of jobs: base.py is the interface for the dispatcher and the table of executors, local.py runs
processes on this machine, ray/ tasks of a cluster."""
