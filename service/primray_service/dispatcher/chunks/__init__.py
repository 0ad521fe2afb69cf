"""Chunks: commands.py makes their commands and fetches their files from an object store, chunk_run.py is
a running chunk, inbox.py and messages.py validate its messages; adoption.py takes over the files that they
leave."""
