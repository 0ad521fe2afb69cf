"""Names of AOVs: what they request, and the channels of a data type."""

from __future__ import annotations

import pytest

from primray.aovs import (
    AovRequest,
    DataType,
    aov_bytes,
    check_names,
    data_type_of,
    is_light_path,
    kind_of,
    light_paths_of,
    occlusion_distance,
    primvars_of,
    requests_of,
    taxonomy_of,
    with_distances,
    without_prefix,
)
from primray.errors import SettingsError


def test_known_names_pass() -> None:
    check_names(["depth", "crypto_object", "beauty", "occlusion:0.5", "primvar:st", "labels:kind", "C.*L"])


@pytest.mark.parametrize("name", ["dpeth", "occlusion:-1", "occlusion:inf", "primvar:", "primvar:a b", "labels:", ""])
def test_unknown_names_are_refused(name: str) -> None:
    with pytest.raises(SettingsError) as refused:
        check_names([name])
    assert refused.value.code == "unknown-aov"


def test_a_name_that_is_nearly_known_is_suggested() -> None:
    with pytest.raises(SettingsError, match="depth"):
        check_names(["dpeth"])


def test_each_name_is_requested_once() -> None:
    assert requests_of(["depth", "beauty", "depth", "alpha"]) == (AovRequest("depth", "depth"),)


def test_light_paths_lose_prefixes_and_blanks() -> None:
    assert without_prefix("color lpe: C .* <L.'my key'>") == "C.*<L.'my key'>"
    requests = requests_of(["C.*L", "lpe:C.*L", "CD+L"])
    assert light_paths_of(requests) == ("C.*L", "CD+L")
    assert [name for name in ("C", "Ci", "Cs", "C.*L", "lpe:x") if is_light_path(name)] == ["C.*L", "lpe:x"]


def test_occlusion_is_within_a_metre_unless_it_has_a_distance() -> None:
    assert [occlusion_distance(name) for name in ("occlusion", "occlusion:2", "occlusion:x", "depth")] == [
        None,
        2.0,
        None,
        None,
    ]
    assert kind_of("occlusion:2") == kind_of("occlusion")
    plain, own = with_distances(requests_of(["occlusion", "occlusion:2"]), meters_per_unit=0.01)
    assert occlusion_distance(plain.source) == pytest.approx(100.0)
    assert occlusion_distance(own.source) == 2.0


def test_sources_name_what_they_read() -> None:
    assert primvars_of(requests_of(["st", "primvar:wear", "primvar:st", "depth"])) == ("st", "wear")
    assert [taxonomy_of(source) for source in ("labels:kind", "depth")] == ["kind", None]


@pytest.mark.parametrize(
    ("text", "channels"),
    [
        ("float", DataType(1, ("",), "float")),
        ("color3f", DataType(3, ("R", "G", "B"), "float")),
        ("color4h", DataType(4, ("R", "G", "B", "A"), "half")),
        ("normal3f", DataType(3, ("X", "Y", "Z"), "float")),
        ("texCoord2f", DataType(2, ("U", "V"), "float")),
        ("half2", DataType(2, ("U", "V"), "half")),
        ("int", DataType(1, ("",), "uint")),
        ("matrix4d", None),
        ("string", None),
    ],
)
def test_channels_of_data_types(text: str, channels: DataType | None) -> None:
    assert data_type_of(text) == channels


def test_errors_and_doubles_take_twice_the_memory() -> None:
    (albedo,), (depth,), (position,) = (requests_of([name]) for name in ("albedo", "depth", "position"))
    assert aov_bytes([position]) == 6 * aov_bytes([depth])
    assert aov_bytes([AovRequest("albedo", "albedo", errors=True)]) == 2 * aov_bytes([albedo])
