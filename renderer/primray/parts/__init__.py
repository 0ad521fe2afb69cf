"""Distributed rendering of one frame: ranges of samples, each rendered by a process, merged to the bits of one render.

    executor.py    the interface of whatever renders a range
    board.py       which samples are assigned, and which are next (pure)
    pace.py        the number of samples of a part (pure)
    asked.py       the settings of the parts and of the merged frame (pure)
    handing_out.py submits ranges to an executor, and again where they are lost
    judging.py     whether the error of the merged samples ends the frame, and where it is measured next
    gather.py      merges parts, measures the error, stops

Nothing here opens a stage or starts a process: render/local_processes.py renders parts on this machine, the service on a
cluster.
"""
