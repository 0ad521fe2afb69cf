"""An interactive view of a stage: kept open, seen through a camera that is moved, rendered again as it or its files change.

`viewed_scene` is the stage and its renders, `orbit` the camera that is moved; `viewer` is the thread that renders, `commands`
are those of clients, `file_watch` looks at files, `aov_pictures` draws what is no light. Nothing here displays anything:
clients ask `viewer` for its state and picture.
"""
