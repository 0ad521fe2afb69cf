"""Copies of layers in memory, which no stage shares: what is read or edited there changes nobody else's layer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from pxr import Sdf, Tf

from ...errors import StageOpenError
from .messages import check_is_text, tf_message


def readable_layer(file: str, *, where: str = "") -> Sdf.Layer:
    """Return a layer in memory with a file's content; StageOpenError, at `where` or the file, where USD cannot parse it."""
    check_is_text(file, where=where)
    try:
        layer = Sdf.Layer.OpenAsAnonymous(file)
    except Tf.ErrorException as error:
        raise StageOpenError(f"USD cannot open it: {tf_message(error)}", where=where or file) from None
    if layer is None:
        raise StageOpenError("USD cannot open it.", where=where or file)
    return layer


@contextmanager
def restored(layer: Sdf.Layer) -> Iterator[None]:
    """Let a layer that a stage uses be edited in memory while the block runs; it is as before at the end."""
    kept = Sdf.Layer.CreateAnonymous(".usda")
    kept.TransferContent(layer)
    try:
        yield
    finally:
        layer.TransferContent(kept)
