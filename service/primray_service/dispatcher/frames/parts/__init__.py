"""A frame that is rendered in several places at a time, by ranges of its samples.

parallel_frame.py   it while it runs: gives out parts, has them merged, and has the picture made of what was merged
course.py           what comes next, where its error decides, and when it has all samples that it will have; ledger.py: which
                    samples are merged, taken, being taken; cutting.py: how many the next part is (all pure)
part_run.py         one part; merge_run.py: putting some together; adopting.py: what that left becomes the frame's
merge_pace.py       how often that is done although nothing waits for it (pure)
told.py             how the frame is doing, from all of its parts
"""
