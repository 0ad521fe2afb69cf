"""Settings in the stage: primray's attributes and those of other renderers, what is read of them and what takes their place."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from typing import Any

import pytest
from pxr import Sdf, Usd

from primray.description.picture_file import PictureView
from primray.diagnostics import Diagnostic, Diagnostics
from primray.installed_packages import SCHEMAS, schema_folder
from primray.render.prepare import with_stage_settings
from primray.settings import Filter, Metric, RenderSettings
from primray.settings.stage_settings import CHECKPOINT_EVERY, StageSettings
from primray.usd import products, translate
from primray.usd.render_settings.stage_settings import NAMES, SETTINGS, VARIABLES, VIEWS

from ..usd_text import stage_of

SETTINGS_API, PRODUCT_API, VAR_API = (f"PrimrayRender{of}API" for of in ("Settings", "Product", "Var"))
# One attribute each: as it is authored, the setting that a render follows, a flag's value, which wins.
TABLE: dict[str, tuple[str, Any, Any]] = {
    "primray:samples": ("int primray:samples = 12", 12, 16),
    "primray:targetError": ("float primray:targetError = 0.001", 0.001, 0.5),
    "primray:errorMetric": ('token primray:errorMetric = "rmse"', Metric.RMSE, Metric.DISPLAY),
    "primray:timeLimit": ("float primray:timeLimit = 2.5", 2.5, 9.0),
    "primray:maxDepth": ("int primray:maxDepth = 3", 3, 2),
    "primray:filter": ('token primray:filter = "gaussian"', Filter.GAUSSIAN, Filter.BLACKMAN_HARRIS),
    "primray:filterWidth": ("float primray:filterWidth = 2", 2.0, 1.5),
    "primray:denoise": ("bool primray:denoise = 1", True, False),
    "primray:motionError": ("float primray:motionError = 0.25", 0.25, 1.0),
}


def settings_text(body: str, product: str = "", head: str = "") -> str:
    of_product = f'def RenderProduct "p"\n{{\n{product}\n}}\n' if product else ""
    to_product = "rel products = </Render/p>\n" if product else ""
    return f'def Scope "Render"\n{{\ndef RenderSettings "s" {head}\n{{\n{to_product}{body}\n}}\n{of_product}}}\n'


def asked_of(body: str, product: str = "", time_code: float | None = None) -> tuple[StageSettings, list[Diagnostic]]:
    description, diagnostics = translate(stage_of(settings_text(body, product)), RenderSettings(time_code=time_code))
    return description.asked, [
        d for d in diagnostics if d.code in ("render-settings-input", "foreign-settings", "other-renderer")
    ]


def followed(body: str, product: str = "", **settings: Any) -> tuple[RenderSettings, list[str]]:
    """The settings that a render follows, and the messages that it gives."""
    told = Diagnostics()
    asked, _ = asked_of(body, product)
    return with_stage_settings(RenderSettings(**settings), asked, told)[0], [d.message for d in told]


def values_of(body: str, product: str = "", time_code: float | None = None) -> dict[str, Any]:
    return {one.name: one.value for one in asked_of(body, product, time_code)[0].asked}


@pytest.mark.parametrize("name", sorted(TABLE))
def test_each_attribute_is_a_setting_and_its_flag_wins(name: str) -> None:
    line, value, flag = TABLE[name]
    field = SETTINGS[name]
    assert values_of(line) == {field: value}
    assert getattr(StageSettings(asked_of(line)[0].asked).applied_to(RenderSettings())[0], field) == value
    assert getattr(StageSettings(asked_of(line)[0].asked).applied_to(RenderSettings(**{field: flag}))[0], field) == flag
    # A product's comes first, and nothing is said of any of it.
    own = line.rsplit(" = ", 1)[0]
    flagged = f'"{flag.value}"' if hasattr(flag, "value") else str(flag).lower() if isinstance(flag, bool) else flag
    found, told = asked_of(line, f"{own} = {flagged}")
    assert (found.asked[0].value, found.asked[0].prim, told) == (flag, "/Render/p", [])


def test_the_table_has_every_attribute() -> None:
    assert set(TABLE) | {"primray:checkpointInterval"} == set(SETTINGS)
    assert values_of("float primray:checkpointInterval = 5") == {CHECKPOINT_EVERY: 5.0}


def test_the_schema_says_what_is_read() -> None:
    layer = Sdf.Layer.FindOrOpen(str(schema_folder() / "generatedSchema.usda"))
    for schema, names in ((SETTINGS_API, NAMES), (PRODUCT_API, NAMES), (VAR_API, VARIABLES)):
        declared = layer.GetPrimAtPath(f"/{schema}").properties
        assert {p.name for p in declared} == set(names)
        assert all(p.documentation for p in declared)
    declared = layer.GetPrimAtPath(f"/{SETTINGS_API}").properties
    for name, (line, value, _) in TABLE.items():
        assert str(declared[name].typeName) == line.split()[0]
        field, default = SETTINGS[name], declared[name].default
        settled = RenderSettings()
        defaults = {"error_metric": settled.metric, "filter": settled.pixel_filter, "motion_error": settled.most_motion_error}
        expected = getattr(defaults.get(field), "value", defaults.get(field, False if field == "denoise" else None))
        assert default == (pytest.approx(expected) if isinstance(expected, float) else expected), name
        if hasattr(value, "value"):
            assert list(declared[name].GetInfo("allowedTokens")) == [choice.value for choice in type(value)]
    assert declared["primray:exposure"].default == PictureView().exposure


def test_the_source_and_the_registered_schema_say_the_same() -> None:
    source, made = (Sdf.Layer.FindOrOpen(str(schema_folder() / f"{name}.usda")) for name in ("schema", "generatedSchema"))
    for schema in (SETTINGS_API, PRODUCT_API, VAR_API):
        ours, theirs = (layer.GetPrimAtPath(f"/{schema}") for layer in (source, made))
        assert ours.documentation == theirs.documentation
        facts = [
            [(p.name, p.typeName, p.default, p.documentation, p.GetInfo("allowedTokens")) for p in spec.properties]
            for spec in (ours, theirs)
        ]
        assert facts[0] == facts[1]


REGISTERED = """
from pxr import Plug, Usd
stage = Usd.Stage.CreateInMemory()
for name, on in (("Settings", "RenderSettings"), ("Product", "RenderProduct"), ("Var", "RenderVar")):
    schema = f"PrimrayRender{name}API"
    prim = stage.DefinePrim(f"/{name}", on)
    assert not prim.CanApplyAPI("PrimrayLensAPI") and prim.ApplyAPI(schema) and prim.HasAPI(schema)
    definition = Usd.SchemaRegistry().FindAppliedAPIPrimDefinition(schema)
    for p in definition.GetPropertyNames():
        a = prim.GetAttribute(p)
        assert definition.GetPropertyDocumentation(p) == a.GetDocumentation() != ""
        print(p, a.GetTypeName(), a.Get())
from primray.settings import RenderSettings
from primray.usd import translate
print(translate(stage, RenderSettings())[0].asked.asked)
"""


def test_usd_registers_the_schema() -> None:
    """In a process of its own: schemas stay registered. What a schema falls back to is nothing that the stage asks for."""
    known = {**os.environ, SCHEMAS: str(schema_folder())}
    ran = subprocess.run([sys.executable, "-c", REGISTERED], env=known, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    *rows, asked = ran.stdout.strip().splitlines()
    assert asked == "()"
    assert sorted(row.split()[0] for row in rows) == sorted([*NAMES, *NAMES, *VARIABLES])
    assert {"primray:filter token box", "primray:errors bool False", "primray:samples int None"} <= set(rows)


@pytest.mark.parametrize("api", ["", SETTINGS_API])
def test_attributes_count_whether_or_not_the_schema_is_applied(api: str) -> None:
    head = f'(\nprepend apiSchemas = ["{api}"]\n)' if api else ""
    description, diagnostics = translate(stage_of(settings_text("int primray:samples = 12", head=head)), RenderSettings())
    assert description.asked.of("spp") == 12
    assert [d.code for d in diagnostics if d.code in ("api-schema", "foreign-schema")] == []


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("int primray:samples = 0", "samples per pixel"),
        ("int primray:samples = 99999999", "16777216"),
        ("float primray:samples = 2.5", "whole number"),
        ("float primray:targetError = -1", "above 0"),
        ('token primray:errorMetric = "psnr"', "'relmse', 'rmse', 'display'"),
        ('token primray:filter = "gauss"', "'box', 'gaussian'"),
        ('string primray:denoise = "yes"', "True or False"),
        ("float primray:checkpointInterval = 0", "above 0"),
        ("float primray:motionError = 0", "above 0"),
    ],
)
def test_values_out_of_range_are_reported_and_strict_refuses(line: str, words: str) -> None:
    asked, told = asked_of(line)
    assert asked == StageSettings()
    [one] = told
    assert one.is_strict
    assert words in one.message
    assert (one.prim_path, one.attribute) == ("/Render/s", line.split()[1])


def test_a_misspelt_name_is_reported_with_what_is_meant() -> None:
    _, told = asked_of("int primray:sample = 12")
    assert [d.message for d in told] == ["primray:sample is unknown: did you mean primray:samples?"]
    text = settings_text("", "rel orderedVars = </v>") + 'def RenderVar "v"\n{\nbool primray:error = 1\n}\n'
    _, diagnostics = translate(stage_of(text), RenderSettings())
    assert "primray:error is unknown: did you mean primray:errors?" in [d.message for d in diagnostics]


def test_values_of_a_time_are_those_of_the_frame() -> None:
    line = "int primray:samples.timeSamples = { 1: 8, 2: 32 }"
    assert values_of(line, time_code=1) == {"spp": 8}
    assert values_of(line, time_code=2) == {"spp": 32}
    assert values_of(line) == {"spp": 8}  # at the default time the earliest


ENDS = """int primray:samples = 64
float primray:targetError = 0.01
token primray:errorMetric = "rmse"
float primray:timeLimit = 60"""


@pytest.mark.parametrize(
    ("flags", "ends"),
    [
        ({}, (64, 0.01, Metric.RMSE, 60.0)),
        ({"spp": 8}, (8, None, Metric.RMSE, None)),
        ({"target_error": 0.5}, (None, 0.5, None, None)),  # a target of the user's is in the default metric
        ({"time_limit_s": 3}, (None, None, Metric.RMSE, 3)),
        ({"error_metric": "rmse"}, (64, 0.01, Metric.RMSE, 60.0)),
        ({"error_metric": "display"}, (64, None, Metric.DISPLAY, 60.0)),  # the stage's target is in another one
        ({"sample_range": (0, 8)}, (None, None, Metric.RMSE, None)),
    ],
)
def test_a_flag_that_ends_the_render_takes_the_place_of_all_ends(flags: dict[str, Any], ends: tuple[Any, ...]) -> None:
    found, _ = followed(ENDS, **flags)
    assert (found.spp, found.target_error, found.error_metric, found.time_limit_s) == ends


def test_a_width_is_of_its_own_filter() -> None:
    body = 'token primray:filter = "gaussian"\nfloat primray:filterWidth = 2'
    assert followed(body)[0].filter_width == 2.0
    assert (followed(body, filter="box")[0].filter_width, followed(body, filter_width=5)[0].filter) == (None, Filter.GAUSSIAN)


def test_products_that_ask_for_other_samples_are_other_renders() -> None:
    text = (
        """def RenderSettings "s"
{
    rel products = [</s/a>, </s/b>, </s/c>]
    int primray:samples = 8
    def RenderProduct "a" { token productName = "a.exr" }
    def RenderProduct "b" { token productName = "b.exr" int primray:samples = 4 }
    def RenderProduct "c" { token productName = "c.exr" string primray:view = "Raw" }
}
""".replace("{ ", "{\n")
        .replace(" int primray:samples = 4", "\nint primray:samples = 4")
        .replace(" string", "\nstring")
        .replace(" }", "\n}")
    )
    from primray.render.prepare import open_once
    from primray.render.products import products_of, renders_of

    def renders(**flags: Any) -> list[list[str]]:
        settings = RenderSettings(**flags)
        made = renders_of(products_of(open_once(stage_of(text), settings), settings))
        return [[product.path for product in together] for _, together in made]

    assert renders() == [["/s/a", "/s/c"], ["/s/b"]]
    assert renders(spp=2) == [["/s/a", "/s/b", "/s/c"]]


def test_views_come_with_the_file() -> None:
    body = 'string primray:view = "Raw"\nfloat primray:exposure = 0.5'
    [product] = products(stage_of(settings_text(body, 'string primray:look = "L"\nfloat primray:exposure = 2')))
    assert product.file.view == PictureView("Raw", None, "L", 2.0)
    assert set(VIEWS.values()) == {"view", "display", "look", "exposure"}
    _, told = asked_of("float primray:view = 1")
    assert [(d.code, d.attribute) for d in told] == [("render-settings-input", "primray:view")]
    _, told = asked_of("float primray:exposure = 101")
    assert ["-100 to 100" in d.message for d in told] == [True]


FOREIGN: dict[str, dict[str, Any]] = {
    "int karma:global:pathtracedsamples = 128": {"spp": 128},
    "int karma:global:samplesperpixel = 9": {"spp": 9},
    "int karma:global:samplesperpixel = 9\nint karma:global:pathtracedsamples = 64": {"spp": 64},
    "float karma:object:diffuselimit = 1\nint karma:object:reflectlimit = 2\nint karma:object:refractlimit = 4": {
        "max_depth": 8
    },
    "int arnold:global:AA_samples = 3": {"spp": 9},
    "int arnold:AA_samples = 4\nint arnold:GI_total_depth = 5": {"spp": 16, "max_depth": 6},
    "int arnold:GI_total_depth = 10\nint arnold:GI_diffuse_depth = 1\nint arnold:GI_specular_depth = 1\n"
    "int arnold:GI_transmission_depth = 2": {"max_depth": 5},
    "int arnold:AA_samples = 3\nint arnold:AA_samples_max = 10": {"spp": 9},
    "int arnold:AA_samples = 3\nint arnold:AA_samples_max = 10\nbool arnold:enable_adaptive_sampling = 1": {"spp": 100},
    "int ri:hider:maxsamples = 256\nint ri:trace:maxdepth = 4": {"spp": 256, "max_depth": 5},
    "int ri:integrator:PxrPathTracer:maxPathLength = 4": {"max_depth": 4},
    "int cycles:samples = 512\nint cycles:integrator:max_bounce = 0\nfloat cycles:time_limit = 30": {
        "spp": 512,
        "time_limit_s": 30.0,
        "max_depth": 1,
    },
    "float cycles:time_limit = 0": {},
}


@pytest.mark.parametrize("body", FOREIGN)
def test_samples_and_depth_of_other_renderers(body: str) -> None:
    assert values_of(body) == FOREIGN[body]
    assert [d.code for d in asked_of(body)[1]] == []  # nothing "not read"
    settings, told = followed(body)
    assert ["is read as" in message for message in told] == [True] * len(FOREIGN[body])
    for name, value in FOREIGN[body].items():
        assert getattr(settings, name) == value
        assert getattr(followed(body, "", **{name: 77})[0], name) == 77


def test_primrays_own_attributes_come_before_those_of_others() -> None:
    others = "int karma:global:pathtracedsamples = 128\nint arnold:GI_total_depth = 5"
    assert values_of(f"int primray:samples = 8\n{others}") == {"spp": 8, "max_depth": 6}
    assert values_of(f"float primray:targetError = 1\n{others}") == {"target_error": 1.0, "max_depth": 6}
    assert values_of("int primray:samples = 8", "int karma:global:pathtracedsamples = 128") == {"spp": 8}
    assert values_of(others, "int karma:global:pathtracedsamples = 4") == {"spp": 4, "max_depth": 6}


def test_several_renderers_that_disagree_are_reported() -> None:
    asked, [told] = asked_of("int karma:global:pathtracedsamples = 128\nint cycles:samples = 8")
    assert asked.of("spp") == 128
    assert told.message == "cycles:samples says 8, karma:global:pathtracedsamples says 128: the latter is used."


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("float ri:Ri:PixelVariance = 0.01", "foreign-settings"),
        ("int karma:object:diffuselimit = 1", "foreign-settings"),  # of the other kinds nothing is known
        ("int arnold:AA_samples = -3", "render-settings-input"),
        ("float cycles:samples = 2.5", "render-settings-input"),
    ],
)
def test_what_has_no_equal_is_reported(line: str, code: str) -> None:
    asked, [told] = asked_of(line)
    assert (asked, told.code, told.attribute) == (StageSettings(), code, line.split()[1])


@pytest.mark.parametrize("link", ["rel ri:integrator = </i>", "token outputs:ri:integrator.connect = </i.outputs:result>"])
def test_the_depth_of_renderman_is_its_integrators(link: str) -> None:
    text = settings_text(link) + 'def "i"\n{\nint inputs:ri:maxIndirectBounces = 3\ntoken outputs:result\n}\n'
    asked = translate(stage_of(text), RenderSettings())[0].asked
    assert [(one.name, one.value, one.prim, one.attribute) for one in asked.asked] == [
        ("max_depth", 4, "/i", "inputs:ri:maxIndirectBounces")
    ]


def test_the_motion_error_is_the_stages() -> None:
    moving = """def Sphere "ball"
{
    double3 xformOp:translate.timeSamples = {0: (0, 0, 0), 1: (3, 5, 0), 2: (6, 0, 0)}
    double xformOp:rotateY.timeSamples = {0: 0, 2: 170}
    uniform token[] xformOpOrder = ["xformOp:rotateY", "xformOp:translate"]
}
def Camera "cam"
{
    double3 xformOp:translate = (0, 0, 40)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    double shutter:close = 2
}
"""

    def segments(body: str, **flags: Any) -> int:
        stage = stage_of(settings_text(f"rel camera = </cam>\n{body}") + moving)
        return max(steps.segments for steps in translate(stage, RenderSettings(time_code=0, **flags))[0].motion_steps)

    fine, coarse = segments(""), segments("float primray:motionError = 8")
    assert coarse < fine
    assert segments("float primray:motionError = 8", motion_error=0.02) == fine


def test_asking_for_nothing_changes_nothing() -> None:
    stage = Usd.Stage.CreateInMemory()
    assert translate(stage, RenderSettings())[0].asked == StageSettings()
    settings = RenderSettings(seed=3)
    assert StageSettings().applied_to(settings)[0] is settings
    assert replace(settings, spp=None) == settings
