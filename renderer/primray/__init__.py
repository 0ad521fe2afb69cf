"""primray renders USD stages on CPUs and returns images with their error. `usd` translates, `render` runs the core.

    >>> import primray
    >>> image = primray.render("shot.usda", resolution=(32, 18), spp=2)
    >>> image.save("shot.png").name
    'shot.png'

What needs numpy is imported when it is first asked for, so that the command line starts quickly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import errors
from .compare import compare
from .errors import PrimrayError
from .lens.diffusion import Diffusion
from .render import render
from .settings import (
    AutoCamera,
    DefaultWrap,
    Eye,
    Filter,
    Ground,
    Metric,
    Panorama,
    RenderContext,
    RenderSettings,
    StopAt,
    StudioLight,
)
from .version import __version__

if TYPE_CHECKING:
    from . import dataset
    from .camera import Camera, Projection, looking_at
    from .checkpoints.checkpointing import Checkpointing
    from .compare.comparison import Comparison, Verdict
    from .compare.sequences import SequenceComparison
    from .diagnosis.doctor import Diagnosis, doctor
    from .diagnosis.estimate import CostEstimate, estimate
    from .diagnosis.inspection import inspect
    from .diagnosis.machine import MachineCheck
    from .diagnosis.pixel_log import PixelLog, debug_pixel
    from .diagnostic_messages import RenderWarning
    from .distributed.local_processes import LocalProcesses
    from .explanation.explained import ExplainedPixel, explain
    from .images.aov import Aov
    from .images.image import Image
    from .images.reading import read_image
    from .incremental.scene import Scene, render_frames
    from .labels.things import Thing
    from .lens.distortion import DirectionTable, Distortion, DistortionModel
    from .light_meter.glare import GlareRating, rate_glare
    from .light_meter.measuring import Measurement, measure
    from .light_meter.meters import LightMeter, MeterGrid, MeterKind
    from .light_mix.mix import LightMix, relight
    from .pinned.pinning import Pinned, pin
    from .pinned.verification import Verification, verify
    from .render.first_hits import FirstHits
    from .render.products import Product, render_products
    from .render.stereo import StereoImage, render_stereo
    from .render.turned_dome import turn_dome
    from .report.profile import profile
    from .sensor.lidar import LidarDetector, LidarScan, lidar
    from .sensor.lidar_pattern import LidarPattern
    from .sensor.model import RawImage, SensorModel

__all__ = [
    "Aov",
    "AutoCamera",
    "Camera",
    "Checkpointing",
    "Comparison",
    "CostEstimate",
    "DefaultWrap",
    "Diagnosis",
    "Diffusion",
    "DirectionTable",
    "Distortion",
    "DistortionModel",
    "ExplainedPixel",
    "Eye",
    "Filter",
    "FirstHits",
    "GlareRating",
    "Ground",
    "Image",
    "LidarDetector",
    "LidarPattern",
    "LidarScan",
    "LightMeter",
    "LightMix",
    "LocalProcesses",
    "MachineCheck",
    "Measurement",
    "MeterGrid",
    "MeterKind",
    "Metric",
    "Panorama",
    "Pinned",
    "PixelLog",
    "PrimrayError",
    "Product",
    "Projection",
    "RawImage",
    "RenderContext",
    "RenderSettings",
    "RenderWarning",
    "Scene",
    "SensorModel",
    "SequenceComparison",
    "StereoImage",
    "StopAt",
    "StudioLight",
    "Thing",
    "Verdict",
    "Verification",
    "__version__",
    "compare",
    "dataset",
    "debug_pixel",
    "doctor",
    "errors",
    "estimate",
    "explain",
    "inspect",
    "lidar",
    "looking_at",
    "measure",
    "pin",
    "profile",
    "rate_glare",
    "read_image",
    "relight",
    "render",
    "render_frames",
    "render_products",
    "render_stereo",
    "turn_dome",
    "verify",
]

if not TYPE_CHECKING:  # type checkers know the names above, and that there are no others
    _WHERE = {
        "Aov": "images.aov",
        "Camera": "camera",
        "Checkpointing": "checkpoints.checkpointing",
        "Comparison": "compare.comparison",
        "CostEstimate": "diagnosis.estimate",
        "Diagnosis": "diagnosis.doctor",
        "DirectionTable": "lens.distortion",
        "ExplainedPixel": "explanation.explained",
        "Distortion": "lens.distortion",
        "DistortionModel": "lens.distortion",
        "FirstHits": "render.first_hits",
        "GlareRating": "light_meter.glare",
        "Image": "images.image",
        "LidarDetector": "sensor.lidar",
        "LidarPattern": "sensor.lidar_pattern",
        "LidarScan": "sensor.lidar",
        "LightMeter": "light_meter.meters",
        "LightMix": "light_mix.mix",
        "LocalProcesses": "distributed.local_processes",
        "MachineCheck": "diagnosis.machine",
        "Measurement": "light_meter.measuring",
        "MeterGrid": "light_meter.meters",
        "MeterKind": "light_meter.meters",
        "Pinned": "pinned.pinning",
        "PixelLog": "diagnosis.pixel_log",
        "Product": "render.products",
        "Projection": "camera",
        "RawImage": "sensor.model",
        "RenderWarning": "diagnostic_messages",
        "Scene": "incremental.scene",
        "SensorModel": "sensor.model",
        "SequenceComparison": "compare.sequences",
        "StereoImage": "render.stereo",
        "Thing": "labels.things",
        "Verdict": "compare.comparison",
        "Verification": "pinned.verification",
        "debug_pixel": "diagnosis.pixel_log",
        "doctor": "diagnosis.doctor",
        "estimate": "diagnosis.estimate",
        "explain": "explanation.explained",
        "inspect": "diagnosis.inspection",
        "lidar": "sensor.lidar",
        "looking_at": "camera",
        "measure": "light_meter.measuring",
        "pin": "pinned.pinning",
        "profile": "report.profile",
        "rate_glare": "light_meter.glare",
        "read_image": "images.reading",
        "relight": "light_mix.mix",
        "render_frames": "incremental.scene",
        "render_products": "render.products",
        "render_stereo": "render.stereo",
        "turn_dome": "render.turned_dome",
        "verify": "pinned.verification",
    }

    def __getattr__(name):
        from importlib import import_module

        if name in ("dataset", "notebook"):  # packages, with names of their own
            return import_module(f"{__name__}.{name}")
        if name not in _WHERE:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f"{__name__}.{_WHERE[name]}"), name)

    def __dir__():
        return sorted(__all__)
