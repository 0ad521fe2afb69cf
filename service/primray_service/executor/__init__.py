"""Executors: where the chunks of jobs run. base.py is what the dispatcher knows of them, by_name.py chooses
one; local.py runs processes here."""
