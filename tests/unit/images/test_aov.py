"""Outputs beside the picture as data: channels, components, data types and errors as their requests have them."""

from __future__ import annotations

import numpy as np
import pytest

from primray.aovs import AovRequest
from primray.images.aov import Aov, channel_names, make_aov

VALUES = np.arange(24, dtype=np.float32).reshape(2, 4, 3)


def test_channels_are_those_of_the_source() -> None:
    assert make_aov(AovRequest("depth", "depth"), VALUES[..., :1]).channels == ("Z",)
    assert make_aov(AovRequest("normal", "normal"), VALUES).channels == ("normal.X", "normal.Y", "normal.Z")
    assert make_aov(AovRequest("primvar:uv", "primvar:uv"), VALUES[..., :2]).channels == ("uv.U", "uv.V")


def test_a_data_type_decides_components_and_storage() -> None:
    wide = make_aov(AovRequest("a", "normal", data_type="color4h"), VALUES)
    assert (wide.channels, wide.stored) == (("a.R", "a.G", "a.B", "a.A"), "half")
    np.testing.assert_array_equal(wide.values[..., :3], VALUES)
    narrow = make_aov(AovRequest("a", "normal", data_type="float"), VALUES)
    assert narrow.channels == ("a",)
    assert narrow.values.shape == (2, 4, 1)
    whole = make_aov(AovRequest("a", "normal", data_type="int"), VALUES, errors=VALUES)
    assert (whole.values.dtype, whole.stored, whole.errors) == (np.uint32, "uint", None)


def test_values_are_read_only_and_fit_their_channels() -> None:
    aov = make_aov(AovRequest("normal", "normal"), VALUES.copy(), errors=VALUES)
    assert not aov.values.flags.writeable
    assert aov.errors is not None
    assert not aov.errors.flags.writeable
    assert aov.error_channels == ("normal.stderr.X", "normal.stderr.Y", "normal.stderr.Z")
    with pytest.raises(ValueError, match="do not hold the channels"):
        Aov(VALUES, ("X", "Y"), "normal", "")
    with pytest.raises(ValueError, match="do not go with"):
        Aov(VALUES, ("X", "Y", "Z"), "normal", "", errors=VALUES[:1])


def test_numpy_sees_the_values_without_a_copy() -> None:
    aov = make_aov(AovRequest("normal", "normal"), VALUES)
    assert np.shares_memory(np.asarray(aov), aov.values)
    assert np.asarray(aov, np.float64).dtype == np.float64


def test_names_of_channels() -> None:
    assert channel_names("a", ("X", "Y")) == ("a.X", "a.Y")
    assert channel_names("", ("R", "G")) == ("R", "G")
    assert channel_names("a", ("Z",)) == ("Z",)
    assert channel_names("", ("",), "alone") == ("alone",)
