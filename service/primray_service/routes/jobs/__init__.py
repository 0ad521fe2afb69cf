"""The routes of jobs: jobs.py lists, shows and changes them, submissions.py makes them, the others are what one has."""
