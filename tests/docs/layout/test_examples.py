"""A small kind of each thing that is added by a row of a table (ARCHITECTURE.md): it takes part as its siblings do."""

from __future__ import annotations

import inspect
import math
import os
import shutil
import subprocess
from dataclasses import dataclass
from typing import Any

import pytest
import typer
from pxr import Usd
from pydantic import ValidationError, create_model
from starlette.responses import Response
from typer.main import get_command

from primray import diagnostic_codes
from primray.checkpoints.checkpoint import identity
from primray.cli.app import with_options
from primray.cli.commands.doctor import doctor
from primray.cli.commands.render import render
from primray.cli.flags import setting_values
from primray.description import Sphere
from primray.diagnostic_codes import Code, Kind, Severity
from primray.diagnostics import Diagnostics
from primray.errors import SettingsError
from primray.incremental.steps import without_sampling_settings
from primray.settings import Counts, RenderSettings, settings_as_json, settings_of_json
from primray.settings.setting import PICTURES, Flag, Member, must, number, setting
from primray.usd.translate import SHAPES, translate
from primray_service import app
from primray_service.api.models import members_of
from primray_service.cli.submit import members_of as members_of_values
from primray_service.cli.submit import submit
from primray_service.executor import base
from primray_service.http.described import answer
from primray_service.http.openapi import openapi
from primray_service.http.routing import Router

from .architecture import ROOT

COMPILER = os.environ.get("CXX") or shutil.which("g++") or shutil.which("c++")


def test_a_prim_type(monkeypatch):
    monkeypatch.setitem(SHAPES, "Ball", lambda prim, ctx: Sphere(prim.path, 1.0, 0))
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/ball", "Ball")
    description, _ = translate(stage, RenderSettings())
    assert [(type(shape), shape.path) for shape in description.shapes] == [(Sphere, "/ball")]


def test_a_diagnostic(monkeypatch):
    monkeypatch.setitem(diagnostic_codes.CODES, "worked-example", Code(Severity.INFO, Kind.NOTE, "An example.", "Nothing."))
    found = Diagnostics()
    found.add("worked-example", "/cube", "This is an example.")
    assert [(one.code, one.severity) for one in found] == [("worked-example", Severity.INFO)]
    with pytest.raises(KeyError):
        found.add("no-such-code", "/cube", "It is in no table.")


@dataclass(frozen=True)
class Worked(RenderSettings):
    grain: float = setting(
        0.0,
        number,
        check=must(math.isfinite, "the grain must be a number"),
        counts=Counts.PIXELS,
        sampling=True,
        flag=Flag(("--grain",), "Grain of the film.", metavar="G", commands=PICTURES),
        member=Member("Grain of the film.", bounds={"ge": 0}),
    )


def test_a_setting():
    refused: list[Any] = ["coarse", math.inf]
    for value in refused:
        with pytest.raises(SettingsError) as refusal:
            Worked(grain=value)
        assert refusal.value.where == "grain"
    grainy = Worked(grain=0.5)
    assert settings_of_json(settings_as_json(grainy), Worked) == grainy
    assert identity(grainy, {})["grain"] == 0.5
    assert without_sampling_settings(grainy) == Worked()


@pytest.mark.parametrize(("command", "function"), [("render", render), ("submit", submit)])
def test_the_flag_of_a_setting(command, function):
    commands = typer.Typer(add_completion=False, rich_markup_mode=None)
    commands.command(command)(with_options(command, function, Worked))
    context = get_command(commands).make_context(command, ["shot.usda", "--grain", "0.5"])
    assert "--grain G" in context.get_help()
    given = {name: value for name, value in context.params.items() if value != ()}  # as Typer hands them on
    values = setting_values(given, Worked)
    assert values["grain"] == 0.5
    assert members_of_values(values, Worked) == {"grain": 0.5}
    assert "grain" not in inspect.signature(with_options("doctor", doctor, Worked)).parameters


def test_the_member_of_a_setting():
    members: dict[str, Any] = members_of("", Worked)
    model: Any = create_model("WorkedSettings", **members)
    assert model().model_dump()["grain"] == 0.0
    assert model.model_json_schema()["properties"]["grain"] == {
        "default": 0.0,
        "description": "Grain of the film.",
        "minimum": 0,
        "title": "Grain",
        "type": "number",
    }
    with pytest.raises(ValidationError):
        model(grain=-1.0)


def test_an_executor(monkeypatch):
    monkeypatch.setitem(base.EXECUTORS, "worked", base.EXECUTORS["local"])
    base.check_executor_name("worked")
    assert base.executor_maker("worked") is base.executor_maker("local")


def test_a_route(monkeypatch):
    router = Router("/v1", resource="worked")

    @router.get("/worked", answer(content={"text/plain": {"type": "string"}}))
    async def worked() -> Response:
        """Return a text."""
        return Response("it is")

    monkeypatch.setattr(app, "ROUTERS", (*app.ROUTERS, router))
    assert "get" in openapi(app.operations())["paths"]["/v1/worked"]


LIGHT = """
#include "light/types/light_types.hpp"
namespace primray {
struct RingLight : DiskLight {
  static constexpr LightType kType = LightType(100);
  static constexpr const char* kName = "RING";
};
int count_rings() {
  int n = 0;
  LightTypeList<DiskLight, RingLight>::for_each([&]<class T>(T) { n += T::kType == LightType(100); });
  return n;
}
}  // namespace primray
"""
SHAPE = """
#include "scene/curved/curved_shapes.hpp"
namespace primray {
struct BallShape : SphereShape {
  static constexpr uint32_t kGeometry = 4;
  static OwnedGeometry geometry(const Record* records, uint32_t count);
};
using Shapes = CurvedKindList<SphereShape, BallShape>;
Shapes* shapes = nullptr;
}  // namespace primray
"""


@pytest.mark.skipif(COMPILER is None, reason="no C++ compiler")
@pytest.mark.parametrize("source", [LIGHT, SHAPE], ids=["a light type", "a shape that the core intersects"])
def test_a_kind_of_the_core(source, tmp_path):
    assert COMPILER is not None
    file = tmp_path / "worked.cpp"
    file.write_text(source)
    flags = ["-std=c++20", "-fsyntax-only", "-march=x86-64-v3", "-w", '-DPRIMRAY_ISA="v3"', "-DPRIMRAY_MAX_LANES=8"]
    subprocess.run([COMPILER, *flags, f"-I{ROOT / 'renderer' / 'core'}", str(file)], check=True)
