"""An interactive view of a stage: kept open, seen through a camera that is moved, rendered again as it or its files change.

`viewed_scene` is the stage, its camera and its renders; `viewer` is the thread that renders, watches files and takes commands
of clients. Nothing here displays anything: clients ask `viewer` for its state and picture.
"""
