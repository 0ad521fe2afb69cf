"""Layers of an image file: parts of a multi-part EXR, and channels that share a prefix ("diffuse.R"). Part of texture.py.

A part's name counts as a prefix of its channels, so that "diffuse" names a part as well as channels of that prefix.
"""

from __future__ import annotations

from typing import Any

from ..errors import AssetError
from .texture_format import Layout, layout_of, prefix_of

# MaterialX, image: "If no value for layer is provided and the input file has multiple layers", these, in this order.
_UNNAMED = ("default", "rgba")
_PLAIN = ("rgba", "rgb")  # names that applications use for channels without a prefix


def choose_layer(image: Any, name: str, shown: str) -> tuple[Any, Layout]:
    """Return the header of the part with a layer, and the layout of its channels; the image is left at that part.

    Without a name: the layer that MaterialX names, else the first part. Raises AssetError where the file has no such layer.
    """
    spec = image.spec()
    if not name:
        return _default_part(image, spec), layout_of(tuple(image.spec().channelnames))
    layers: list[str] = []
    for part in range(_parts(spec)):
        if not image.seek_subimage(part, 0):
            break
        spec = image.spec()
        names, label = tuple(spec.channelnames), _label(spec)
        chosen = _channels(names, label, name)
        if chosen:
            own = layout_of(tuple(names[c].rpartition(".")[2] for c in chosen))
            return spec, Layout(tuple(chosen[c] for c in own.channels), own.colors)
        layers += [found for found in dict.fromkeys([label, *map(prefix_of, names)]) if found]
    has = f"it has {', '.join(dict.fromkeys(layers))}" if layers else "it has no layers"
    raise AssetError(f"the texture has no layer {name!r}: {has}", where=shown, code="texture-unreadable")


def _parts(spec: Any) -> int:
    return max(int(spec.getattribute("oiio:subimages") or 1), 1)


def _label(spec: Any) -> str:
    return str(spec.getattribute("oiio:subimagename") or spec.getattribute("name") or "")


def _default_part(image: Any, spec: Any) -> Any:
    count = _parts(spec)
    if count > 1:
        labels: dict[str, int] = {}
        for part in range(count):
            if image.seek_subimage(part, 0):
                labels.setdefault(_label(image.spec()), part)
        image.seek_subimage(next((labels[name] for name in _UNNAMED if name in labels), 0), 0)
    return image.spec()


def _channels(names: tuple[str, ...], label: str, layer: str) -> list[int]:
    """Return the channels of a layer in a part that is named `label`."""
    prefixes = [prefix_of(name) for name in names]
    own = [i for i, prefix in enumerate(prefixes) if prefix == layer]
    if not own and label:
        own = [i for i, prefix in enumerate(prefixes) if (f"{label}.{prefix}" if prefix else label) == layer]
        own = own or (list(range(len(names))) if label == layer else [])
    if not own and layer.lower() in _PLAIN:
        own = [i for i, prefix in enumerate(prefixes) if not prefix]
    # A single channel by its full name ("N.Y").
    return own or [i for i, name in enumerate(names) if layer in (name, f"{label}.{name}")]
