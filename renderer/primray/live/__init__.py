"""A stage that somebody looks at: kept open, seen through a camera that is moved, rendered anew as it or its files change.

`viewed_scene` is the stage and its renders, `orbit` the camera's moves, `file_watch` who says that files changed, `viewer` the
thread in which all that happens, `commands` what it can be told from outside. Nothing here shows anything: whoever does asks
`viewer` for its state and picture.
"""
