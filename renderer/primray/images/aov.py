"""An output beside the picture (AOV): its values, its channels, and the meaning of its ids."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ..aovs import RGB, UV, AovRequest, Stored, data_type_of, kind_of, occlusion_distance, primvar_of

Values = npt.NDArray[Any]
# Layers of a channel's standard errors, and of the signed differences of both replicates: NAME.stderr.X, NAME.difference.X.
STDERR, DIFFERENCE = "stderr", "difference"


@dataclass(frozen=True, eq=False, repr=False)
class Aov:
    """`values` (H, W, C): float32, float64 (positions) or uint32 (`stored` as whole numbers), read-only.

    docs/aovs.md has each one's unit and space. `ids` names what each id stands for; 0 is nothing.

    >>> image = primray.render("shot.usda", aovs=["depth", "prim"], resolution=(32, 18), spp=2)
    >>> image.aovs["depth"].values.shape, image.aovs["depth"].meaning != ""
    ((18, 32, 1), True)
    >>> sorted(image.aovs)
    ['depth', 'prim']

    `errors` (H, W, C) are standard errors of values that are means of samples, if requested. Like those of an Image they have
    one degree of freedom each: average their squares over pixels. `differences` (H, W, C) are signed, of both replicates and
    distributed like the errors, where they are requested: the error of a weighted sum of outputs is that of their differences.

    >>> image = primray.render("shot.usda", aovs=["albedo"], aov_errors=True, resolution=(32, 18), spp=2)
    >>> image.aovs["albedo"].errors.shape
    (18, 32, 3)
    """

    values: Values
    channels: tuple[str, ...]
    source: str
    meaning: str
    stored: Stored = "float"  # data type in a file
    ids: Mapping[int, str] = field(default_factory=dict)  # names of the ids in `values`
    metadata: Mapping[str, str] = field(default_factory=dict)  # further attributes of the file's header
    errors: Values | None = None  # float32; None: exact, or not requested
    samples: int | None = None  # samples per pixel of values with their own samples, the same in every render
    differences: Values | None = None  # float32, NaN where there is no estimate; None: not requested

    def __post_init__(self) -> None:
        values = np.ascontiguousarray(self.values)
        if values.ndim != 3 or values.shape[2] != len(self.channels):
            raise ValueError(f"values of shape {values.shape} do not hold the channels {self.channels}")
        values.flags.writeable = False
        object.__setattr__(self, "values", values)
        for name in ("errors", "differences"):
            if getattr(self, name) is None:
                continue
            held = np.ascontiguousarray(getattr(self, name), np.float32)
            if held.shape != values.shape:
                raise ValueError(f"{name} of shape {held.shape} do not go with values of shape {values.shape}")
            held.flags.writeable = False
            object.__setattr__(self, name, held)

    def __repr__(self) -> str:
        height, width, _ = self.values.shape
        return f"<Aov {self.source}, {width} x {height}, {' '.join(self.channels)}, {self.values.dtype}>"

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> Values:
        """Return `values`, read-only if NumPy need not copy."""
        if copy is False and dtype is not None and np.dtype(dtype) != self.values.dtype:
            raise ValueError(f"values of {self.values.dtype} cannot be {np.dtype(dtype)} without a copy")
        return np.array(self.values, dtype) if copy else np.asarray(self.values, dtype)

    def as_json(self) -> dict[str, Any]:
        """Return the report's entry on this output, without values and ids, which are in the image and its file."""
        found = {"source": self.source, "channels": list(self.channels), "stored": self.stored, "meaning": self.meaning}
        return found | ({"ids": len(self.ids)} if self.ids else {}) | ({"errors": True} if self.errors is not None else {})

    @property
    def error_channels(self) -> tuple[str, ...]:
        """Channel names of `errors` in a file: "albedo.stderr.R" for "albedo.R"."""
        return self._channels_of(STDERR)

    @property
    def difference_channels(self) -> tuple[str, ...]:
        """Channel names of `differences` in a file: "lights.key.difference.R" for "lights.key.R"."""
        return self._channels_of(DIFFERENCE)

    def _channels_of(self, of: str) -> tuple[str, ...]:
        parted = [channel.rpartition(".") for channel in self.channels]
        return tuple(f"{layer}.{of}.{letter}" if layer else f"{letter}.{of}" for layer, _, letter in parted)


def make_aov(
    request: AovRequest,
    values: Values,
    ids: Mapping[int, str] | None = None,
    errors: Values | None = None,
    samples: int | None = None,
) -> Aov:
    """Return an AOV with the components, data type and channel names of its request.

    `errors` and `samples` are as in Aov, for the components of the source.
    """
    kind, wanted = kind_of(request.source), data_type_of(request.data_type)
    primvar = primvar_of(request.source)
    meaning = kind.meaning if kind is not None else f"the primvar {primvar}; 0 where nothing has it"
    if (distance := occlusion_distance(request.source)) is not None:
        meaning = meaning.replace("a distance", f"{distance:g} scene units")
    if wanted is None:
        width = values.shape[2]
        letters = kind.channels if kind is not None else (("",), UV, RGB, ("R", "G", "B", "A"))[width - 1]
        stored: Stored = "uint" if values.dtype == np.uint32 else "float"
        name = request.name if kind is not None else str(primvar)
        name = name if request.prefix is None else request.prefix
        return Aov(
            values=values,
            channels=channel_names(name, letters, request.name),
            source=request.source,
            meaning=meaning,
            stored=stored,
            ids=ids or {},
            metadata={},
            errors=errors,
            samples=samples,
        )
    if errors is not None:
        errors = None if wanted.stored == "uint" else _with_components(errors, wanted.components)
    values = _as_type(_with_components(values, wanted.components), wanted.stored)
    channels = channel_names(request.name if request.prefix is None else request.prefix, wanted.letters, request.name)
    return Aov(
        values=values,
        channels=channels,
        source=request.source,
        meaning=meaning,
        stored=wanted.stored,
        ids=ids or {},
        metadata={},
        errors=errors,
        samples=samples,
    )


def channel_names(name: str, letters: tuple[str, ...], alone: str = "") -> tuple[str, ...]:
    """Return channel names in OpenEXR's form NAME.X. A single channel has the plain name, or `alone` if that is empty."""
    if len(letters) == 1:
        return (letters[0] or name or alone,)
    return tuple(f"{name}.{letter}" if name else letter for letter in letters)


def _with_components(values: Values, count: int) -> Values:
    """Return the first `count` components. One component is repeated; other missing ones are 0."""
    have = values.shape[2]
    if have >= count:
        return values[..., :count]
    if have == 1:
        return np.repeat(values, count, axis=2)
    return np.concatenate([values, np.zeros((*values.shape[:2], count - have), values.dtype)], axis=2)


def _as_type(values: Values, stored: Stored) -> Values:
    if stored == "uint" and values.dtype != np.uint32:
        with np.errstate(invalid="ignore"):
            whole: Values = np.clip(np.nan_to_num(np.rint(values.astype(np.float64))), 0, 2**32 - 1).astype(np.uint32)
        return whole
    if stored != "uint" and values.dtype == np.uint32:
        return np.asarray(values, np.float32)
    return values
