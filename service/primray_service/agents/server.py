"""The tools that agents call, as a server of the Model Context Protocol. Each call names its stage by a path below a root.

Pictures are content beside the table, never in structured content, which clients show models as text.
"""

from __future__ import annotations

import asyncio
import json
import os
import socket
import time
from collections.abc import AsyncIterator, Coroutine, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import uvicorn
from mcp.server import MCPServer
from mcp.server.mcpserver import Context
from mcp.server.mcpserver.exceptions import ResourceError, ToolError
from mcp_types import CallToolResult, ImageContent, ResourceLink, TextContent, ToolAnnotations
from pydantic import Field, ValidationError

from primray.errors import PrimrayError, SettingsError
from primray.version import __version__

from .scene_processes import SceneLimits, SceneProcesses

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
MOST_VIEWS = 6
MOST_SESSIONS, SESSION_IDLE_S, MOST_BODY_BYTES = 64, 1800.0, 2**20
SHUTDOWN_S = 2
PROGRESS_S = 1.0  # between reports of progress
GRACE_S = 30.0  # of an answer beyond its seconds, for opening and preparing a heavy stage
INSTRUCTIONS = (
    "primray renders USD stages. Begin with look: pictures, and a table of what is seen where, by prim. After an edit of the "
    "stage's files, compare shows what changed beyond noise since the last look. Every tool takes the stage's path. Shares are "
    "percent of the picture, boxes are pixels [x0, y0, x1, y1] from the upper left."
)

Scene = Annotated[str, Field(description="Path of the USD stage, below one of the server's roots.", max_length=4096)]
View = Annotated[
    str,
    Field(
        description="default (the stage's own camera, else an automatic one), a camera's path, front, back, left, right, top, "
        "bottom, three-quarter, or AZIMUTH,ELEVATION in degrees.",
        min_length=1,
        max_length=1024,
    ),
]
Views = Annotated[list[View], Field(description="Views, a picture for each.", min_length=1, max_length=MOST_VIEWS)]
Frame = Annotated[
    str | None,
    Field(
        description="Path of the prim that fills the picture; default is then three-quarter. null: everything.",
        min_length=1,
        max_length=4096,
    ),
]
TimeCode = Annotated[float | None, Field(description="Time code; null: the stage without a frame.", allow_inf_nan=False)]
Variants = Annotated[
    list[Annotated[str, Field(max_length=1024)]], Field(description="Variants to choose, PRIM:SET=NAME.", max_length=32)
]
MOST_SIDE = 768  # pixels of a picture in an answer
Size = Annotated[int, Field(description="Pixels of the picture's longer side.", ge=64, le=MOST_SIDE)]
Taxonomy = Annotated[str, Field(description="Taxonomy of the labels that the table names.", pattern=r"^\w{1,64}$")]
LookSeconds = Annotated[float, Field(description="Seconds for all views, once the stage is known.", ge=0.1, le=30)]
PilotSeconds = Annotated[float, Field(description="Seconds of rendering to measure.", ge=0.1, le=30)]
READS = ToolAnnotations(readOnlyHint=True, idempotentHint=True, openWorldHint=False)
WRITES = ToolAnnotations(readOnlyHint=False, destructiveHint=False, idempotentHint=True, openWorldHint=False)


@dataclass(frozen=True, kw_only=True)
class Access:
    """What agents may reach: stages below `roots`, and a folder that `render` writes to."""

    roots: tuple[Path, ...]
    output: Path
    most_seconds: float = 60.0

    def stage(self, text: str, member: str = "scene") -> str:
        """Return the file's real path; SettingsError where it is no stage below a root."""
        if "\0" in text:
            raise SettingsError("a path has no NUL in it", where=member, code="outside-roots")
        places = [text] if os.path.isabs(text) else [os.path.join(root, text) for root in self.roots]
        found = [path for path in map(os.path.realpath, places) if any(Path(path).is_relative_to(root) for root in self.roots)]
        named = ", ".join(map(str, self.roots))
        if not found:
            raise SettingsError(f"{text} is not below a root of this server: {named}", where=member, code="outside-roots")
        there = next((path for path in found if os.path.isfile(path)), None)
        if there is None or not there.lower().endswith(SUFFIXES):
            raise SettingsError(f"{text} is no USD file below {named}", where=member, code="no-such-stage")
        return there

    def file(self, name: str) -> Path:
        """Return the file of a render's name in the output folder."""
        return self.output / f"{name}.exr"


def create_server(access: Access, limits: SceneLimits) -> MCPServer[Any]:
    """Return the server; its scenes live as long as it runs."""
    keeping: list[SceneProcesses] = []
    rendered: set[str] = set()

    @asynccontextmanager
    async def lifespan(_: MCPServer[Any]) -> AsyncIterator[None]:
        scenes = SceneProcesses(access.roots, limits)
        keeping.append(scenes)
        scenes.get_ready()
        try:
            yield
        finally:
            keeping.remove(scenes)
            await scenes.close()

    app = _Server("primray", version=__version__, instructions=INSTRUCTIONS, lifespan=lifespan, log_level="WARNING")

    async def asked(
        does: str, scene: str, seconds: float, context: Context, into: Mapping[str, Path] | None = None, **members: Any
    ) -> CallToolResult:
        try:
            path = access.stage(scene)
            if members.get("before") is not None:
                members["before"] = access.stage(members["before"], "before")
            request = {"do": does, "path": path, "time_code": None, "variants": [], **members, "seconds": seconds}
            found = await _reported(keeping[-1].answer(path, request, seconds * 2 + GRACE_S, into), seconds, context)
        except PrimrayError as error:
            raise ToolError(str(error)) from None
        return _result(found["answer"], found["pictures"])

    @app.tool(annotations=READS, structured_output=False)
    async def look(
        scene: Scene,
        context: Context,
        views: Views = ["default"],  # noqa: B006 - read only
        frame: Frame = None,
        time_code: TimeCode = None,
        variants: Variants = [],  # noqa: B006
        size: Size = 512,
        seconds: LookSeconds = 0.4,
        taxonomy: Taxonomy = "class",
        denoise: Annotated[
            bool, Field(description="Show the pictures without noise, by a filter that may smooth details.")
        ] = False,
    ) -> CallToolResult:
        """Look at a stage: a picture of each view, and by prim its share of the picture, box, distance and label.

        More seconds give less noise, and the full size where a scene is slow.
        """
        return await asked(
            "look",
            scene,
            seconds,
            context,
            views=views,
            frame=frame,
            time_code=time_code,
            variants=variants,
            size=size,
            taxonomy=taxonomy,
            denoise=denoise,
        )

    @app.tool(annotations=READS, structured_output=False)
    async def compare(
        scene: Scene,
        context: Context,
        before: Annotated[str | None, Field(description="Another stage; null: this one as of its last look.")] = None,
        view: View = "default",
        frame: Frame = None,
        time_code: TimeCode = None,
        variants: Variants = [],  # noqa: B006
        size: Size = 512,
        seconds: LookSeconds = 4.0,
        tolerance: Annotated[float, Field(description="Smallest relative difference that matters.", ge=0, le=1)] = 0.02,
        taxonomy: Taxonomy = "class",
        follow_camera: Annotated[bool, Field(description="Look from the same direction at what is there now.")] = False,
    ) -> CallToolResult:
        """Show what changed in a view, beyond noise: the verdict, where, on which prims, and what came, went and moved.

        Before is the same view of the last look (or compare) of this stage, or another stage.
        """
        return await asked(
            "compare",
            scene,
            seconds,
            context,
            before=before,
            views=[view],
            frame=frame,
            time_code=time_code,
            variants=variants,
            size=size,
            tolerance=tolerance,
            taxonomy=taxonomy,
            follow_camera=follow_camera,
        )

    @app.tool(annotations=READS, structured_output=False)
    async def inspect(
        scene: Scene,
        context: Context,
        time_code: TimeCode = None,
        camera: str | None = None,
        variants: Variants = [],  # noqa: B006
    ) -> CallToolResult:
        """List a stage's layers, cameras, variants, lights, materials, textures, counts and diagnostics, without rendering."""
        return await asked("inspect", scene, 30, context, time_code=time_code, camera=camera, variants=variants)

    @app.tool(annotations=READS, structured_output=False)
    async def doctor(
        scene: Scene,
        context: Context,
        time_code: TimeCode = None,
        camera: str | None = None,
        variants: Variants = [],  # noqa: B006
        size: Size = 512,
        seconds: PilotSeconds = 1.0,
    ) -> CallToolResult:
        """Say why a stage comes out slow, grey, dark or empty, each finding with what to do."""
        return await asked("doctor", scene, seconds, context, time_code=time_code, camera=camera, variants=variants, size=size)

    @app.tool(annotations=READS, structured_output=False)
    async def estimate(
        scene: Scene,
        context: Context,
        target_errors: Annotated[
            list[Annotated[float, Field(gt=0, allow_inf_nan=False)]],
            Field(description="Relative mean square errors; none: round ones.", max_length=8),
        ] = [],  # noqa: B006
        time_code: TimeCode = None,
        camera: str | None = None,
        variants: Variants = [],  # noqa: B006
        size: Annotated[int, Field(description="Width of the render in pixels.", ge=16, le=8192)] = 1920,
        seconds: PilotSeconds = 2.0,
    ) -> CallToolResult:
        """Predict the samples and seconds that a render needs to reach an error."""
        members: dict[str, Any] = {"time_code": time_code, "camera": camera, "variants": variants, "size": size}
        return await asked("estimate", scene, seconds, context, target_errors=target_errors, **members)

    @app.tool(annotations=WRITES, structured_output=False)
    async def render(
        scene: Scene,
        context: Context,
        name: Annotated[str, Field(description="Name of the EXR in the server's folder.", pattern=r"^[A-Za-z0-9][\w-]{0,63}$")],
        view: View = "default",
        frame: Frame = None,
        time_code: TimeCode = None,
        variants: Variants = [],  # noqa: B006
        size: Annotated[int, Field(description="Pixels of the picture's longer side.", ge=16, le=4096)] = 1280,
        target_error: Annotated[float, Field(description="Relative mean square error to stop at.", gt=0, lt=1)] = 0.001,
        seconds: Annotated[float, Field(description="Most seconds of sampling.", ge=0.1)] = 20.0,
    ) -> CallToolResult:
        """Render a view to an EXR and a PNG in the server's output folder, to an error or for a time, and show a small picture.

        A picture larger than that is linked as a resource.
        """
        if seconds > access.most_seconds:
            raise ToolError(f"time: at most {access.most_seconds:g} seconds, not {seconds:g} [seconds]")
        into, picture_file = access.file(name), access.file(name).with_suffix(".png")
        found = await asked(
            "render",
            scene,
            seconds,
            context,
            {"render.exr": into, "render.png": picture_file},
            file="render.exr",
            views=[view],
            frame=frame,
            time_code=time_code,
            variants=variants,
            size=size,
            target_error=target_error,
        )
        rendered.add(name)
        return _linked(_with(found, file=str(into), picture=str(picture_file)), name, picture_file)

    @app.resource(
        "primray://picture/{name}",
        name="picture",
        mime_type="image/png",
        description="The picture of a `render`, at its full size.",
    )
    async def picture(name: str) -> bytes:
        if name not in rendered:
            raise ResourceError(f"no-such-picture: no render of this server is named {name}")
        return await asyncio.to_thread(access.file(name).with_suffix(".png").read_bytes)

    _forbid_unknown_arguments(app)
    return app


def _result(answer: dict[str, Any], pictures: Sequence[dict[str, Any]]) -> CallToolResult:
    """Return the table as text and the pictures, each under its name."""
    content: list[Any] = [TextContent(type="text", text=json.dumps(answer, ensure_ascii=False))]
    for one in pictures:
        width, height = one["size"]
        content.append(TextContent(type="text", text=f"{one['name']}, {width} x {height}:"))
        content.append(ImageContent(type="image", data=one["data"], mime_type=one["type"]))
    return CallToolResult(content=content)


def _with(result: CallToolResult, **members: Any) -> CallToolResult:
    first, *rest = result.content
    assert isinstance(first, TextContent)
    text = json.dumps({**json.loads(first.text), **members}, ensure_ascii=False)
    return CallToolResult(content=[TextContent(type="text", text=text), *rest])


def _linked(result: CallToolResult, name: str, file: Path) -> CallToolResult:
    """Return the result of a render with a link to the picture, where it is larger than the one in the result."""
    (table, *_) = result.content
    assert isinstance(table, TextContent)
    width, height = json.loads(table.text)["size"]
    if max(width, height) <= MOST_SIDE:
        return result
    link = ResourceLink(
        uri=f"primray://picture/{name}",
        name=f"{name}.png",
        description=f"The picture at {width} x {height}.",
        mime_type="image/png",
        size=file.stat().st_size,
    )
    return CallToolResult(content=[*result.content, link])


async def _reported(work: Coroutine[Any, Any, dict[str, Any]], seconds: float, context: Context) -> dict[str, Any]:
    """Await an answer, and report every second how long it has taken: clients without news may give up."""
    task, begun = asyncio.ensure_future(work), time.monotonic()
    try:
        while not (await asyncio.wait({task}, timeout=PROGRESS_S))[0]:
            elapsed = time.monotonic() - begun
            await context.report_progress(elapsed, max(seconds, elapsed), f"{elapsed:.0f} s")
        return task.result()
    finally:
        if not task.done():
            task.cancel()
            with suppress(asyncio.CancelledError, PrimrayError):
                await task


class _Server(MCPServer[Any]):
    """A server whose refusals of arguments read as its other errors: a code, a sentence and the argument."""

    async def call_tool(self, name: str, arguments: dict[str, Any], context: Context[Any, Any] | None = None) -> Any:
        try:
            return await super().call_tool(name, arguments, context)
        except ToolError as error:
            if isinstance(error.__cause__, ValidationError):
                raise ToolError(f"Error executing tool {name}: {_refusal(error.__cause__, name)}") from None
            raise


def _refusal(error: ValidationError, tool: str) -> str:
    """Return what is wrong with the first argument that is refused, without pydantic's own words and addresses."""
    first, *rest = error.errors(include_url=False, include_context=False)
    argument = ".".join(map(str, first["loc"]))
    given = json.dumps(first["input"], default=str)
    match first["type"]:
        case "extra_forbidden":
            sentence = f"{tool} has no argument {argument}"
        case "missing":
            sentence = f"{tool} needs {argument}"
        case _:
            said = first["msg"].removeprefix("Input ").removeprefix("String ")
            sentence = f"{argument} {said}, not {given if len(given) <= 80 else f'{given[:77]}...'}"
    more = f" ({len(rest)} more)" if rest else ""
    return f"argument: {sentence}{more} [{argument}]"


def _forbid_unknown_arguments(app: MCPServer[Any]) -> None:
    """Have the tools refuse arguments that they do not have, which the SDK ignores."""
    for tool in app._tool_manager.list_tools():
        model = tool.fn_metadata.arg_model
        model.model_config["extra"] = "forbid"
        model.model_rebuild(force=True)
        tool.parameters["additionalProperties"] = False


async def serve(app: MCPServer[Any], listener: socket.socket | None) -> None:
    """Serve HTTP until a signal, which ends answers that take longer than SHUTDOWN_S; without a listener until stdin ends."""
    if listener is None:
        await app.run_stdio_async()
        return
    over_http = app.streamable_http_app(
        json_response=True,
        max_sessions=MOST_SESSIONS,
        session_idle_timeout=SESSION_IDLE_S,
        max_request_body_size=MOST_BODY_BYTES,
    )
    config = uvicorn.Config(over_http, log_level="warning", timeout_graceful_shutdown=SHUTDOWN_S)
    await uvicorn.Server(config).serve([listener])
