"""The routes: one file for each resource, each with a `router` (or several); app.py lists them. jobs/ has those of a job.

Routes parse, call one function, and answer. Calls of the store run in threads (`def` routes, or in_thread).
"""
