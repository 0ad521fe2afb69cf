"""Chunks: commands.py says what one is to do, bringing.py brings its files from an object store, chunk_run.py and check_run.py
are one that runs, inbox.py and messages.py what it says, checked; adoption.py takes over the files that it leaves."""
