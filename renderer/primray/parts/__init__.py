"""One frame by many processes: its samples in ranges, each rendered apart, merged to the bits of one render.

    executor.py    what renders a range somewhere: the interface
    board.py       which samples are taken, and which are to be next (pure)
    pace.py        how many samples a part should have (pure)
    asked.py       what is asked of a frame, as its parts and their sum are asked it (pure)
    handing_out.py gives ranges to an executor, again where they were lost
    judging.py     whether the error of what was merged ends the frame, and where it is measured next
    gather.py      merges what comes, measures the error, stops

It knows no stage and no machine: render/local_processes.py renders parts in processes here, the service on a cluster.
"""
