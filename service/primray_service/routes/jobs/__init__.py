"""The routes of jobs: jobs.py lists, shows and changes them, submissions.py creates them, the others serve their parts."""
