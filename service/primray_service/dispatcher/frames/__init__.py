"""A frame from its claim to the row that says how it ended.

running.py           a frame while it runs: its chunk and the chunk's messages
outcomes.py          the outcome of a frame whose chunk has ended (pure); run_completion.py stores it
parts/               a frame that is rendered as several parts at a time
progress_reports.py, totals.py   the job's progress, and sums over its frames; shared_jobs.py: state that its frames share
"""
