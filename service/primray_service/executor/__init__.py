"""Executors: where the chunks of jobs run. base.py is what the dispatcher knows of them; local.py runs processes here."""
