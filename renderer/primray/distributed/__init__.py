"""Distributed rendering of one frame: ranges of samples, each rendered by a process, merged to the bits of one render.

executor.py         the interface of whatever renders a range
planner.py          which samples are assigned, which are next, and how many a part has (pure)
gather.py           submits ranges to an executor, merges parts, measures the error, stops
spot_checks.py      an executor of parts of machines that are not trusted
local_processes.py  an executor that renders parts in processes on this machine; the service has one for a cluster
"""
