"""A stand-in for translation and the core, so that the front is tested without USD files and without rendering."""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass, field, replace
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import primray
from primray.core import Splits
from primray.description import Camera, Light, LightType, Projection, SceneDescription, TextureFile
from primray.diagnostics import Diagnostics
from primray.errors import StageOpenError
from primray.render.render import OpenedFrames
from primray.report.summary import ImageSize
from primray.sampling.error import ErrorRow, Estimate, FrameError
from primray.sampling.schedule import Stop


def make_camera(**changes: Any) -> Camera:
    camera = Camera("/cam", np.eye(4), Projection.PERSPECTIVE, (-0.5, 0.5, -0.25, 0.25), (0.1, 100.0))
    return replace(camera, **changes)


def make_dome(texture: str | None = None, color_space: str = "auto") -> Light:
    file = TextureFile(texture, color_space) if texture else None
    return Light("/dome", LightType.DOME, np.eye(4), (1.0, 1.0, 1.0), texture=file)


def make_description(**changes: Any) -> SceneDescription:
    description = SceneDescription((), (), (), (), (), (make_dome(),), make_camera(), (8, 4), "Y", 0.01, None)
    return replace(description, **changes)


STAGE_FACTS: dict[str, Any] = {
    "layers": ["shot.usda", "car.usda"],
    "default_prim": "/World",
    "up_axis": "Z",
    "meters_per_unit": 0.01,
    "time": {"start": 1.0, "end": 9.0, "time_codes_per_second": 24.0, "frames_per_second": 24.0, "sampled": [1.0, 8.0]},
    "variants": [{"prim": "/World/car", "set": "color", "selection": "red", "names": ["blue", "red"]}],
    "payloads": {"loaded": ["/a"], "unloaded": ["/b"]},
    "prim_types": {"Mesh": 3},
    "purposes": {"default": 2, "proxy": 1},
    "native_instances": 5,
    "native_prototypes": 1,
    "point_instancers": [{"path": "/i", "instances": 7, "prototypes": ["/i/p"]}],
    "draw_modes": [{"prim": "/m", "mode": "cards"}],
}


@dataclass
class FakePipeline:
    """What the stand-ins return, and what they were called with."""

    description: SceneDescription = field(default_factory=make_description)
    opening: list[tuple[str, str, str]] = field(default_factory=list)  # what opening says
    diagnostics: list[tuple[str, str, str]] = field(default_factory=list)  # what translating says
    dicing: list[tuple[str, str, str]] = field(default_factory=list)  # what dicing says
    building: list[tuple[str, str, str]] = field(default_factory=list)  # what building says
    memory_bytes: int = 2**20
    interrupt: bool = False
    invalid_samples: int = 0
    composition: Any = None
    calls: list[str] = field(default_factory=list)
    textures: dict[Any, Any] = field(default_factory=dict)

    def open_stage(self, stage: Any, diagnostics: Diagnostics, composition: Any = None) -> Any:
        self.composition = composition
        self.calls.append(f"open {stage}")
        if stage == "missing.usda":
            raise StageOpenError("there is no such file", where=stage)
        for code, path, message in self.opening:
            diagnostics.add(code, path, message)
        return stage

    def translate(self, stage: Any, settings: primray.RenderSettings, _: object) -> tuple[SceneDescription, Diagnostics]:
        self.calls.append(f"translate {settings.time_code}")
        diagnostics = Diagnostics()
        for code, path, message in self.diagnostics:
            diagnostics.add(code, path, message)
        resolution = settings.resolution or (8, 4)
        resolution = (resolution[0], resolution[1] or resolution[0] // 2)
        return replace(self.description, resolution=resolution, time_code=settings.time_code), diagnostics

    def build(
        self,
        description: SceneDescription,
        textures: dict[Any, Any],
        settings: primray.RenderSettings,
        shapes: list[Any],
        kept: Any,
        **_: Any,
    ) -> Any:
        self.calls.append("build")
        self.textures = textures
        return SimpleNamespace(
            warnings=self.building,
            features=[{"name": "dome", "why": "/dome"}],
            memory_bytes=1000,
            texture_memory=None,
            description=description,
            rendering_space=description.rendering_space,
            bounds=(np.zeros(3), np.ones(3)),
        )

    def begin(self, scene: Any, settings: primray.RenderSettings) -> FakeSampling:
        self.calls.append("render")
        return FakeSampling(self, scene, settings)


class FakeSampling:
    """In place of sampling.Sampling: two steps, the second of which an interruption leaves out."""

    def __init__(self, pipeline: FakePipeline, scene: Any, settings: primray.RenderSettings) -> None:
        self.pipeline = pipeline
        self.scene = scene
        self.settings = settings
        self.stop: Stop | None = None
        self.splits, self.lane_occupancy, self.seconds, self.earlier_rays = Splits(), 0.97, 0.5, 0
        self.rows: list[ErrorRow] = []
        self.view_fault = ""

    def run(self, progress: Any, pause: Any = None) -> bool:
        stopped = progress(0.5, 100, 300) is False
        interrupted = self.pipeline.interrupt or stopped
        if not interrupted:
            progress(1.0, 200, 600)
        width, height = self.scene.description.resolution
        spp = self.settings.most_samples
        pixels = np.random.default_rng(self.settings.seed).random((height, width, 4), dtype=np.float32)
        self.film = SimpleNamespace(
            unseen_walks={},
            image=lambda: (pixels, 0.1 * pixels[..., :3]),
            samples=width * height * spp,
            rays=1000,
            rays_by_kind={"camera": 600, "scattered": 300, "shadow": 100},
            invalid_samples=self.pipeline.invalid_samples,
            samples_per_pixel=(spp // 2, spp) if interrupted else (spp, spp),
        )
        known = Estimate(0.01, 0.009, 0.011)
        self.rows = [ErrorRow(spp, 0.5, FrameError(known, known, np.ones(1), known), False)]
        self.stop = Stop("interrupted" if interrupted else "samples", None)
        return True


@pytest.fixture
def pipeline(monkeypatch: pytest.MonkeyPatch) -> FakePipeline:
    """Replaces primray.usd, primray.core and primray.report.summary for one test."""
    import primray.denoising.denoised
    import primray.report.picture_checks
    import primray.report.vague_error
    import primray.sampling.sampling  # before their core is taken away: what is imported now keeps the fake for other tests

    fake = FakePipeline()

    def install(name: str, **functions: Any) -> None:
        module = ModuleType(f"primray.{name}")
        module.__dict__.update(functions)
        monkeypatch.setitem(sys.modules, f"primray.{name}", module)
        if "." not in name:
            monkeypatch.setattr(primray, name, module, raising=False)

    # What frames keep is of real stages: tests/unit/keeping.
    monkeypatch.setattr("primray.incremental.scene._open_kept", OpenedFrames)
    install(
        "usd",
        open_stage=fake.open_stage,
        translate=fake.translate,
        read_asset=lambda path: b"",
        camera_paths=lambda stage: ["/cam", "/other"],
        stage_facts=lambda stage: STAGE_FACTS,
        stage_name=str,
        products=lambda stage, settings, diagnostics=None: (),
        output_facts=lambda stage, settings: {"render_settings": [], "products": [], "render_passes": []},
    )
    install(
        "core",
        dice=lambda description, settings, textures, known, on_cage: (description, fake.dicing),
        build=fake.build,
        isa=lambda: "v4",
        lanes=lambda: 16,
        versions=lambda: {"embree": "4.4.0"},
    )
    monkeypatch.setattr("primray.sampling.sampling.Sampling", SimpleNamespace(begin=fake.begin))
    install(
        "report.summary",
        summary=lambda description, dicing_rate=4.0, images=(): _Summary(fake.memory_bytes),
        ImageSize=ImageSize,
        counts=asdict,
        primvar_names=lambda description: {"st": 2},
        volume_facts=lambda description: [
            {
                "path": "/smoke",
                "instances": 2,
                "box": [[0, 0, 0], [1, 4, 0.75]],
                "grids": [{"name": "density", "voxels": 7, "size": [1, 2, 3], "voxel_size": [0.5, 2, 0.25], "bytes": 2**20}],
            }
        ],
        motion_facts=lambda description: None,
        texture_sizes=lambda description, read: {"/no/such.png": None},
    )
    return fake


@dataclass(frozen=True)
class _Summary:
    memory_bytes: int
    triangles: int = 12

    @property
    def memory_parts(self) -> dict[str, int]:
        return {"geometry": self.memory_bytes}
