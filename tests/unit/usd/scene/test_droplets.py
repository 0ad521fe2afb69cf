"""Diameters of water droplets: of fog, of Volumes and their materials, and of materials that fill shapes."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Sdf
from tests.unit.usd.scene.test_fog import fog_of, stage_of
from tests.unit.usd.volumes.test_in_shapes import SCATTERS, material, node, surface_of, wire
from tests.unit.usd.volumes.volume_text import grid, translated, volume_text, write

import primray
from primray import RenderSettings
from primray.core.inputs import phase_number
from primray.usd.scene.droplets import DIAMETER, LARGEST

SCHEMAS = Path(__file__).resolve().parents[4] / "schemas" / "usd"
MIST = "float primray:fog:density = 1\nfloat primray:fog:top = 3\n"
TWO_LOBES = (
    """def Material "Look" {
    token outputs:mtlx:volume.connect = <volume.outputs:out>
    %s
    def Shader "volume" { uniform token info:id = "ND_volume"
        token inputs:vdf.connect = <../sum.outputs:out>
        token outputs:out
    }
    def Shader "sum" { uniform token info:id = "ND_add_vdf"
        token inputs:in1.connect = <../ahead.outputs:out>
        token inputs:in2.connect = <../back.outputs:out>
        token outputs:out
    }
"""
    + "".join(
        f"""def Shader "{name}" {{ uniform token info:id = "ND_anisotropic_vdf"
        vector3f inputs:scattering.connect = <../density.outputs:out>
        float inputs:anisotropy = {g}
        token outputs:out
    }}
"""
        for name, g in (("ahead", 0.8), ("back", -0.4))
    )
    + """def Shader "density" { uniform token info:id = "ND_geompropvalue_vector3"
        string inputs:geomprop = "density"
        vector3f outputs:out
    }
}
"""
)


def test_fog_has_them() -> None:
    found, said = fog_of(f"{MIST}float primray:fog:dropletDiameter = 12\n")
    assert found is not None
    assert (found.droplets, found.anisotropy, phase_number(found)) == (12.0, 0.0, 14.0)
    assert said == []
    plain, _ = fog_of(f"{MIST}float primray:fog:anisotropy = 0.5\n")
    assert plain is not None
    assert (plain.droplets, phase_number(plain)) == (0.0, 0.5)


def test_they_win_over_an_anisotropy() -> None:
    both = "float primray:fog:anisotropy = 0.5\nfloat primray:fog:dropletDiameter = {}\n"
    found, said = fog_of(MIST + both.format(5))
    assert found is not None
    assert phase_number(found) == 7.0
    assert said == [("material-input", "primray:fog:anisotropy")]
    found, said = fog_of(MIST + both.format(0))
    assert found is not None
    assert (phase_number(found), said) == (0.5, [])


@pytest.mark.parametrize(("authored", "used"), [(-1.0, 0.0), (51.0, LARGEST), (1e9, LARGEST)])
def test_diameters_are_clamped(authored: float, used: float) -> None:
    found, said = fog_of(f"{MIST}float primray:fog:dropletDiameter = {authored}\n")
    assert found is not None
    assert found.droplets == used
    assert said == [("out-of-range", "primray:fog:dropletDiameter")]
    _, said = fog_of(f'{MIST}string primray:fog:dropletDiameter = "fine"\n')
    assert said == [("wrong-type", "primray:fog:dropletDiameter")]


def test_a_volume_has_them_in_storms_convention(tmp_path: Path) -> None:
    write(tmp_path, grid(2.0))
    description, said, messages = translated(tmp_path, volume_text(extra=f"float {DIAMETER} = 8"))
    assert [(m.droplets, m.anisotropy) for m in description.media] == [(8.0, 0.0)]
    assert said == [("volume-convention", "/Smoke")]
    assert "droplets of 8 micrometres" in messages[0]


def test_they_replace_all_lobes_of_a_shader(tmp_path: Path) -> None:
    write(tmp_path, grid(2.0))
    plain, _, _ = translated(tmp_path, volume_text(bound="/Look") + TWO_LOBES % "")
    assert sorted(m.anisotropy for m in plain.media) == pytest.approx([-0.4, 0.8])
    description, said, messages = translated(tmp_path, volume_text(bound="/Look") + TWO_LOBES % f"float {DIAMETER} = 20")
    (found,) = description.media
    assert (found.droplets, found.anisotropy, found.albedo) == (20.0, 0.0, (1.0, 1.0, 1.0))
    assert found.extinction == pytest.approx([sum(m.extinction[k] for m in plain.media) for k in range(3)])
    assert said == [("volume-convention", "/Smoke")]
    assert "whatever anisotropy its shader has" in messages[0]


def test_a_volumes_own_wins_over_its_materials(tmp_path: Path) -> None:
    write(tmp_path, grid(2.0))
    text = volume_text(bound="/Look", extra=f"float {DIAMETER} = 8") + TWO_LOBES % f"float {DIAMETER} = 20"
    assert [m.droplets for m in translated(tmp_path, text)[0].media] == [8.0]
    text = volume_text(bound="/Look", extra=f"float {DIAMETER} = 0") + TWO_LOBES % f"float {DIAMETER} = 20"
    assert {m.droplets for m in translated(tmp_path, text)[0].media} == {0.0}


def test_what_absorbs_alone_has_none(tmp_path: Path) -> None:
    write(tmp_path, grid(2.0))
    text = """def Material "Look" {
        token outputs:mtlx:volume.connect = <volume.outputs:out>
        def Shader "volume" { uniform token info:id = "ND_volume"
            token inputs:vdf.connect = <../soot.outputs:out>
            token outputs:out
        }
        def Shader "soot" { uniform token info:id = "ND_absorption_vdf"
            vector3f inputs:absorption = (1, 1, 1)
            token outputs:out
        }
    }
    """
    description, _, _ = translated(tmp_path, volume_text(bound="/Look", extra=f"float {DIAMETER} = 8") + text)
    assert all(m.albedo == (0.0, 0.0, 0.0) for m in description.media)


def test_unknown_names_and_other_prims_are_reported(tmp_path: Path) -> None:
    write(tmp_path, grid(2.0))
    _, said, _ = translated(tmp_path, volume_text(extra="float primray:volume:dropletRadius = 8"))
    assert said == [("unknown-input", "/Smoke"), ("volume-convention", "/Smoke")]
    ball = 'def Sphere "Ball" (prepend apiSchemas = ["PrimrayVolumeAPI"]) {\n}\n'
    _, said, _ = translated(tmp_path, ball)
    assert said == [("api-schema", "/Ball")]


def test_the_schema_may_be_applied_where_it_belongs(tmp_path: Path) -> None:
    write(tmp_path, grid(2.0))
    applied = volume_text(extra=f"float {DIAMETER} = 8").replace(
        '"Smoke" ', '"Smoke" (prepend apiSchemas = ["PrimrayVolumeAPI"])'
    )
    look = (TWO_LOBES % "").replace('"Look"', '"Look" (prepend apiSchemas = ["PrimrayVolumeAPI"])')
    assert translated(tmp_path, applied + look)[1] == [("volume-convention", "/Smoke")]


def test_a_filled_shape_has_them_by_its_material() -> None:
    text = material(node("v", "ND_volume", wire("vdf", "b")), SCATTERS).replace("{", f"{{\nfloat {DIAMETER} = 20", 1)
    surface, said = surface_of(text)
    assert surface.volume is not None
    assert (surface.volume.droplets, phase_number(surface.volume)) == (20.0, 22.0)
    assert said == ["material-input"]
    even = SCATTERS.replace("anisotropy = 0.5", "anisotropy = 0")
    surface, said = surface_of(text.replace(SCATTERS, even))
    assert surface.volume is not None
    assert (surface.volume.droplets, said) == (20.0, [])


def test_the_schema_has_what_is_read() -> None:
    for name in ("schema.usda", "generatedSchema.usda"):
        layer = Sdf.Layer.FindOrOpen(str(SCHEMAS / name))
        assert [p.name for p in layer.GetPrimAtPath("/PrimrayVolumeAPI").properties] == [DIAMETER]
        assert layer.GetAttributeAtPath("/PrimrayFogAPI.primray:fog:dropletDiameter").default == 0


def test_an_edit_is_seen_by_a_kept_scene() -> None:
    look = material(node("v", "ND_volume", wire("vdf", "b")), SCATTERS)
    ball = 'def Sphere "ball" (prepend apiSchemas = ["MaterialBindingAPI"]) {\n rel material:binding = </m>\n}\n'
    eye = "    double3 xformOp:translate = (0, 0, 5)\n    uniform token[] xformOpOrder = ['xformOp:translate']\n"
    stage = stage_of(MIST, eye, look + ball + 'def SphereLight "lamp" {\n float inputs:intensity = 9\n}\n')
    settings = RenderSettings(resolution=(8, 5), spp=2)
    kept, seen = primray.Scene(stage), set()
    kept.render(settings)
    for prim, name in (("/m", DIAMETER), ("/World", "primray:fog:dropletDiameter")):
        attribute = stage.GetPrimAtPath(prim).CreateAttribute(name, Sdf.ValueTypeNames.Float)
        for diameter in (5.0, 30.0):
            attribute.Set(diameter)
            found, whole = kept.render(settings).report, primray.render(stage, settings).report
            assert found["pixels_sha256"] == whole["pixels_sha256"]
            seen.add(found["pixels_sha256"])
    assert len(seen) == 4
