"""Flags of usdrecord and husk without a counterpart in primray, with the alternative; and flags that primray can ignore.

docs/from-usdrecord-and-husk.md lists every flag of both; tests/docs/flags keeps page, tables and parser consistent.
"""

from __future__ import annotations

_STREAMS = "the shell does that: `> FILE`, `>> FILE`, `2> FILE`, or `--report FILE` for the facts of a render"
_SESSION = "author it in a layer and give that with --session-layer FILE"
_NO_LICENSE = "primray needs no license: leave it out"
_NO_PLUGIN = "primray renders by itself, with no Hydra delegate: leave it out"
_NO_VIEWER = "there is no mplay; -o tev:// shows the render in a running tev, and `primray view` shows it in a browser"
_NO_SCRIPT = "no scripts run in a render; change the stage before, or by --session-layer FILE"
_BY_SAMPLES = (
    "a picture is divided by its samples: --sample-range A:B, then `primray merge`; --region LEFT BOTTOM RIGHT TOP "
    "renders a part of it"
)
_NO_BUCKETS = "all pixels become better together, there are no buckets and no modes: leave it out"
_NO_PROCEDURALS = "Houdini's procedurals do not run here; bake them into the stage"
_NO_TRACE = "--report FILE has the seconds and the memory of every stage of a render"
_SNAPSHOT = "--snapshot S writes the picture so far to the output's own file, which the end of the render replaces"
_HEADLIGHT = "a stage without lights gets a studio light; --studio-light off leaves it dark"
_LIGHTS = f"to take lights out, deactivate them: {_SESSION}"
_LIST_INSPECT = (
    "`primray inspect` shows what a stage is made of, and --render-settings lists what there is if it finds no such prim"
)

# Refused flags, with the alternative.
REFUSED: dict[str, str] = {
    # usdrecord
    "--disableDrawMode": f"draw modes are followed; to undo one, set model:drawMode to default: {_SESSION}",
    "--resolver": "assets are always resolved in the root layer's context, as by `--resolver root`: leave it out",
    "--enableDomeLightVisibility": "domes are seen by the camera unless the stage hides them: leave it out",
    "--traceToFile": _NO_TRACE,
    "--traceFormat": _NO_TRACE,
    "--memstats": _NO_TRACE,
    "--renderer": _NO_PLUGIN,
    # husk: information
    "--version": "`primray --version` prints versions",
    "-v": "`primray --version` prints versions",
    "--list-settings": _LIST_INSPECT,
    "--list-renderers": _NO_PLUGIN,
    "--properties": "`primray render --help` lists what can be set; docs/supported.md what is read from a stage",
    "--property-definition": "`primray render --help` lists what can be set; docs/supported.md what is read from a stage",
    "--property-definitions": "`primray render --help` lists what can be set; docs/supported.md what is read from a stage",
    "--property-definition-file": "`primray render --help` lists what can be set; docs/supported.md what is read from a stage",
    "--property-definitions-file": "`primray render --help` lists what can be set; docs/supported.md what is read from a stage",
    "--procedurals": _NO_PROCEDURALS,
    "--filters": "--filter chooses the pixel filter; --denoise puts a denoised picture beside the record",
    "--baking-info": "textures are not baked here: leave it out",
    # husk: Karma
    "--engine": _NO_PLUGIN,
    "--bucket-size": _NO_BUCKETS,
    "--bucket-order": _NO_BUCKETS,
    "--image-mode": _NO_BUCKETS,
    "--progressive-passes": _NO_BUCKETS,
    "--autotile": _NO_BUCKETS,
    "--disable-lighting": _LIGHTS,
    "--ao-samples": "there is no ambient occlusion shading; a white dome light over the stage looks alike",
    "--ao-distance": "there is no ambient occlusion shading; a white dome light over the stage looks alike",
    "--headlight": _HEADLIGHT,
    "--autoheadlight": _HEADLIGHT,
    "--dicingcamera": "surfaces are diced for the camera that renders; --dicing-rate says how finely",
    "--optimize-offline": "it changes nothing in husk either: leave it out",
    "--convergence-mode": "--target-error E stops at an error, and --adaptive puts samples where the error is",
    "--karma-percent-of-samples": "--spp N says how many samples a pixel has",
    "--oiio-max-memory-percent": "--max-memory SIZE limits the whole render",
    # husk: USD
    "--usd-input": "name the stage without a flag: primray render STAGE",
    "--resolver-context": "assets are resolved in the root layer's context; configure the resolver by its environment",
    "--resolver-context-string": "assets are resolved in the root layer's context; configure the resolver by its environment",
    "--variant-fallback": "--variant PRIM:SET=NAME chooses a variant of a prim",
    "--disable-scene-materials": f"to take materials off, block their bindings: {_SESSION}",
    "--disable-scene-lights": _LIGHTS,
    "--disable-dummy-raster-product": "a stage without products gets one picture: leave it out",
    "--pass": "--render-pass PRIM renders a pass; the RenderSettings alone are --render-settings PRIM",
    "--prerender-script": _NO_SCRIPT,
    "--preframe-script": _NO_SCRIPT,
    "--postframe-script": _NO_SCRIPT,
    "--postrender-script": _NO_SCRIPT,
    "--allowed-procedurals": _NO_PROCEDURALS,
    "--capture-procedurals": _NO_PROCEDURALS,
    "--procedurals-capture-directory": _NO_PROCEDURALS,
    "--usd-trace": _NO_TRACE,
    "--usd-chrome-file": _NO_TRACE,
    # husk: output
    "--pixel-aspect": f"set pixelAspectRatio of the RenderSettings: {_SESSION}",
    "--extra-metadata": "--metadata NAME=VALUE adds an attribute to an EXR's header, and may be repeated",
    "--ocio": "PNG and JPEG always go through OpenColorIO; --view, --display and --look choose how",
    "--slap-comp": "compositing is for a compositor, with the parts that --aov writes",
    "--autocrop": "pixels are not looked at; --region LEFT BOTTOM RIGHT TOP renders the part of the frame that is wanted",
    "--mplay-monitor": _NO_VIEWER,
    "--mplay-scale": _NO_VIEWER,
    "--mplay-update": _NO_VIEWER,
    "--mplay-session": _NO_VIEWER,
    "--mplay-bgimage": _NO_VIEWER,
    "--mplay-remotehost": _NO_VIEWER,
    "--mplay-gamma": _NO_VIEWER,
    "--mplay-lut": _NO_VIEWER,
    # husk: frames
    "--frame-list": "--frames takes lists by commas: --frames 1,5,9",
    # husk: rendering
    "-R": _NO_PLUGIN,
    "--delegate-options": _NO_PLUGIN,
    "--restart-delegate": "every frame is built anew: leave it out",
    "--snapshot-path": _SNAPSHOT,
    "--snapshot-suffix": _SNAPSHOT,
    "--snapshot-save-mode": _SNAPSHOT,
    "--tile-count": _BY_SAMPLES,
    "--tile-index": _BY_SAMPLES,
    "--tile-suffix": _BY_SAMPLES,
    "--timelimit": "--time-limit S limits the sampling of each frame; there is none for the whole sequence",
    "--timelimit-image": "--time-limit S limits the sampling of each frame",
    "--timelimit-nosave-partial": "a picture that a limit stopped is saved; exit code 5 tells that --target-error was missed",
    "--stdout": _STREAMS,
    "--stderr": _STREAMS,
    "--append-stdout": _STREAMS,
    "--append-stderr": _STREAMS,
    "--windows-console": _STREAMS,
    # husk: licenses
    "--check-licenses": _NO_LICENSE,
    "--skip-licenses": _NO_LICENSE,
    "--list-license-checks": _NO_LICENSE,
    "--skip-license-modes": _NO_LICENSE,
    "--check-license-modes": _NO_LICENSE,
    "--license-release-delay": _NO_LICENSE,
    "--license-max-seat-hold": _NO_LICENSE,
    "--apprentice": _NO_LICENSE,
    "--indie": _NO_LICENSE,
    "--core": _NO_LICENSE,
    "--pdg": _NO_LICENSE,
}

# Ignored flags, with their number of values and the reason.
DONE_ANYWAY: dict[str, tuple[int, str]] = {
    "--disableGpu": (0, "no GPU is used"),
    "--no-mplay": (0, "there is no mplay"),
    "--disable-delegate-products": (0, "all products are pictures"),
    "--disable-disk-check": (0, "the disk is not asked how much it holds"),
    "--fast-exit": (1, "a render ends at once when its files are written"),
    "--exrmode": (1, "there is one way to write an EXR"),
}
