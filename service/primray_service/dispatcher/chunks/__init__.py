"""Chunks: commands.py makes their commands, stage_inputs.py fetches their files from an object store, chunk_run.py and
check_run.py are running chunks, inbox.py and messages.py validate their messages; adoption.py takes over the files that they
leave."""
