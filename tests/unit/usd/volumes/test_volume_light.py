"""Volumes with VolumeLightAPI: what they emit is multiplied by the light's color and intensity."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.unit.usd.volumes.volume_text import grid, translated, volume_text, write

from primray.description import SceneDescription


def fire(
    folder: Path, extra: str = "", schema: str = "VolumeLightAPI", fields: tuple[str, ...] = ("density", "emission")
) -> tuple[SceneDescription, list[tuple[str, str]]]:
    write(folder, grid(0.5), grid((0.1, 0.2, 0.3), name="emission", kind="vec3s"))
    applied = f'(prepend apiSchemas = ["{schema}"])' if schema else ""
    text = volume_text(dict.fromkeys(fields, ""), extra=extra).replace('"Smoke"', f'"Smoke" {applied}', 1)
    description, told, messages = translated(folder, text)
    rest = [(code, message) for (code, path), message in zip(told, messages, strict=True) if path == "/Smoke"]
    return description, [(code, message) for code, message in rest if code != "volume-convention"]


def emission_of(description: SceneDescription) -> tuple[float, float, float]:
    (found,) = description.volume_emissions
    return found.emission


@pytest.mark.conforms("VolumeLightAPI.light:shaderId")
@pytest.mark.parametrize("schema", ["VolumeLightAPI", "LightAPI"])
def test_the_light_tints_the_emission(tmp_path: Path, schema: str) -> None:
    plain, _ = fire(tmp_path, schema="")
    light = "float inputs:intensity = 3\nfloat inputs:exposure = 1\ncolor3f inputs:color = (1, 0.5, 0.25)\n"
    light += 'uniform token light:materialSyncMode = "materialGlowTintsLight"\nuniform token light:shaderId = "VolumeLight"'
    found, told = fire(tmp_path, light, schema)
    assert emission_of(found) == pytest.approx(
        tuple(6 * e * c for e, c in zip(emission_of(plain), (1, 0.5, 0.25), strict=True))
    )
    assert found.media[0].extinction == plain.media[0].extinction
    assert told == []


def test_by_default_it_changes_nothing(tmp_path: Path) -> None:
    plain, _ = fire(tmp_path, schema="")
    found, told = fire(tmp_path)
    assert emission_of(found) == emission_of(plain)
    assert told == []


@pytest.mark.conforms("VolumeLightAPI.light:materialSyncMode", state="diagnosed")
@pytest.mark.parametrize("mode", ["independent", "noMaterialResponse"])
def test_modes_of_surfaces_are_reported(tmp_path: Path, mode: str) -> None:
    found, told = fire(tmp_path, f'float inputs:intensity = 2\nuniform token light:materialSyncMode = "{mode}"')
    assert emission_of(found) == pytest.approx(tuple(2 * e for e in emission_of(fire(tmp_path, schema="")[0])))
    assert [code for code, _ in told] == ["light-input"]
    assert mode in told[0][1]


def test_without_emission_it_is_dark(tmp_path: Path) -> None:
    found, told = fire(tmp_path, fields=("density",))
    assert not found.volume_emissions
    assert [code for code, _ in told] == ["light-dark"]


def test_what_has_no_effect_is_reported(tmp_path: Path) -> None:
    extra = "bool inputs:normalize = 1\nfloat inputs:diffuse = 0.5\nrel collection:lightLink:excludes = </Wall>"
    _, told = fire(tmp_path, extra)
    (message,) = (message for code, message in told if code == "light-input")
    for name in ("inputs:normalize", "inputs:diffuse", "collection:lightLink:excludes"):
        assert name in message


def test_it_is_the_stages_light(tmp_path: Path) -> None:
    assert not fire(tmp_path)[0].lights, "no studio light is added"
