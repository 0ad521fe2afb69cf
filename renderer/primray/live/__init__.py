"""An interactive view of a stage: kept open, seen through a camera that is moved, rendered again as it or its files change.

`viewed_scene` is the stage and its renders, `orbit` moves the camera, `file_watch` reports changed files, `viewer` is the
thread in which all that happens, with the commands that clients may send. Nothing here displays anything: clients ask `viewer`
for its state and picture.
"""
