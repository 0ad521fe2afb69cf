"""Chunks: commands.py makes their commands and fetches their files from an object store, chunk_run.py is a running chunk,
messages.py validates its messages, adoption.py takes over the files that it leaves."""
