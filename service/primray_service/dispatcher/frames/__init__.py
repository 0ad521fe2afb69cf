"""A frame from its claim to the row that says how it ended.

running.py           it while it runs: its chunk, and what comes from it
outcomes.py          what becomes of it once its chunk has ended (pure); run_completion.py writes that down
parts/               a frame that is rendered in several places at a time
progress_reports.py, report_throttle.py, totals.py   how its job is doing, how often that is told, what the frames add up to
"""
