"""A frame that is rendered in several slots at a time, as parts: ranges of its samples.

parallel_frame.py   the frame while it runs: hands out parts, has them merged, and has the picture made from the merged samples
plan.py             the next part, the next decision about the error, and the end; which samples are merged, done or in progress
                    (pure); primray.distributed.planner: samples in the next part
part_run.py         one part; the frame's progress, from all of its parts
merge_run.py        one merge, the adoption of its checkpoint, and the pace of merges
"""
