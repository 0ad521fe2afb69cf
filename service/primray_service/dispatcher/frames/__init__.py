"""A frame from its claim to the row that says how it ended.

running.py           a frame while it runs: its chunk and the chunk's messages
outcomes.py          the outcome of a frame whose chunk has ended (pure); run_completion.py stores it
job_progress.py      state that a job's frames share, and reports of progress; totals.py: sums over its frames
"""
