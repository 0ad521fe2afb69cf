"""`primray submit`: uploads a scene to a service and creates a job of it."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from primray.cli import option_values
from primray.cli.console import print_line
from primray.cli.flags import (
    CONTENTS,
    DIFFUSION,
    FRAMES,
    LIGHTING,
    REFUSAL,
    SIZE,
    SURFACES,
    VIEWPOINT,
    frames_in,
    in_order,
    setting_values,
)
from primray.settings import RenderSettings, rows
from primray.settings.setting import as_json

from .connection import Json, KeyFile, Labels, Server, connected, labels_of
from .exits import FAILED, INTERRUPTED, SCENE_REJECTED, USAGE, CommandError, error_of
from .job_text import plain
from .jobs import Overwrite, download_all, end_as, watched
from .scene_file import SceneFile, scene_file, with_images

if TYPE_CHECKING:
    from ..client import Client, Job, Scene
    from ..client.documents import Settings, Webhook


SHARED = "shared:"  # shared:NAME/path.usda: a stage on the service's shared storage


@in_order(
    *("scene", *VIEWPOINT, *SIZE, *FRAMES, "target_error", "error_metric", "time_limit_s", "spp", "seed", "denoise", "stop_at"),
    *("adaptive", "max_depth", "clamp_indirect", "caustics", "aovs", "aov_errors", "filter", "filter_width", *LIGHTING),
    *("product", "all_products", "view", "display", "look", "exposure", "half", "compression"),
    *(*CONTENTS, *SURFACES, *DIFFUSION, "lens_flaws", *REFUSAL),
)
def submit(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="A usda, usdc, usd or usdz file, or a zip of them.", show_default=False)
    ],
    product: list[str] | None = None,
    all_products: bool = False,
    view: str | None = None,
    display: str | None = None,
    look: str | None = None,
    exposure: str | None = None,
    half: list[str] | None = None,
    compression: str | None = None,
    entry: Annotated[
        str | None, typer.Option(metavar="LAYER", help="Root layer to render, if a zip has several.", show_default=False)
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT", help="The job's name; also set as a label.", show_default="made from file, camera and frames"
        ),
    ] = None,
    priority: Annotated[int | None, typer.Option(metavar="N", help="0 to 100; higher goes first.", show_default="50")] = None,
    parallel: Annotated[
        str | None,
        typer.Option(
            metavar="N|auto",
            help="Most slots in which each frame is rendered at a time, as parts; auto: all.",
            show_default="one",
        ),
    ] = None,
    label: Labels = None,
    ttl: Annotated[
        float | None, typer.Option(metavar="DAYS", help="Time to keep the job after its end.", show_default="the server's")
    ] = None,
    webhook: Annotated[
        str | None, typer.Option(metavar="URL", help="URL to call when the job has ended.", show_default=False)
    ] = None,
    wait: Annotated[
        bool, typer.Option("--wait", "--watch", help="Follow the job to its end, and exit with its result.")
    ] = False,
    fetch: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Follow the job, then download its files to this folder.", show_default=False),
    ] = None,
    overwrite: Overwrite = False,
    server: Server = None,
    key_file: KeyFile = None,
    json: Json = False,
    **flags: Any,
) -> None:
    """Upload a scene with the files that it refers to, and create a job of it. Prints the job's id."""
    values = setting_values(flags)
    settings = members_of(values) | given(
        {
            "frames": frames_in(flags, str(scene)),
            "products": products_of(product, all_products),
            "view": view,
            "display": display,
            "look": look,
            "exposure": option_values.exposure_of(exposure),
            "half": list(option_values.encoding_of(None, half).half) or None,
            "compression": compression,
        }
    )
    labels = ({"name": name} if name else {}) | labels_of(label)
    with connected("submit", server, key_file) as client:
        uploaded, its_entry, images = uploaded_scene(
            client, scene, json, images_of(scene, values.get("dome"), values.get("background"))
        )
        job = client.submit(
            uploaded,
            entry=entry or its_entry,
            settings=_settings(settings | images),
            name=name,
            parallel=parallel_of(parallel),
            priority=priority,
            labels=labels,
            ttl_s=None if ttl is None else ttl * 86_400,
            webhook=_webhook(webhook),
        )
        if json:
            # includes the webhook's secret, this once
            print_line({"type": "job", **client.document(job.id), "webhook": job.webhook})
        else:
            print(job.id, flush=True)
        if job.webhook and job.webhook.get("secret") and not json:
            print(f"the webhook's secret, shown only once: {job.webhook['secret']}", file=sys.stderr)
        if wait or fetch is not None:
            _follow(client, job, fetch, json, overwrite)


def _follow(client: Client, job: Job, folder: Path | None, as_json: bool, overwrite: bool) -> None:
    """Follow the job to its end, which decides the exit code; then download its files into the folder, if one is named."""
    ended = watched(client, job, as_json)
    if folder is not None:
        download_all(client, ended.id, folder, as_json, overwrite=overwrite)
    end_as(ended)


def products_of(paths: list[str] | None, all_of_them: bool) -> list[str] | None:
    """Return a job's products: all, those at these paths, or None for the first; CommandError if both were given."""
    if paths and all_of_them:
        raise CommandError("product-option", "--all-products and --product exclude each other; give one", USAGE)
    return ["*"] if all_of_them else paths or None


def members_of(values: Mapping[str, Any], of: type = RenderSettings) -> dict[str, Any]:
    """Return settings as members of a job's settings, without those at their defaults, which the server chooses."""
    found: dict[str, Any] = {}
    for row in rows(of):
        if row.member is None or values.get(row.name, row.default) == row.default:
            continue
        place, _, name = (row.member.name or row.name).rpartition(".")
        members = found.setdefault(place, {}) if place else found
        members[name] = as_json(values[row.name])
    return found


def given(members: dict[str, Any]) -> dict[str, Any]:
    """Return the members that are not None; the server chooses the others."""
    return {name: value for name, value in members.items() if value is not None}


def parallel_of(text: str | None) -> int | Literal["auto"] | None:
    """Return the value of --parallel; CommandError if it is neither a number nor auto."""
    if text is None or text == "auto":
        return text  # type: ignore[return-value]
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise CommandError("parallel-option", f"--parallel {text}: write a number of at least 1, or auto", USAGE)
    return int(text)


def _settings(settings: dict[str, Any]) -> Settings | None:
    return settings or None  # type: ignore[return-value]  # the server checks its values


def _webhook(url: str | None) -> Webhook | None:
    return None if url is None else {"url": url}


def images_of(scene: Path, dome: str | None, background: str | None) -> dict[str, Path]:
    """Return the image files to send with the scene, by setting; a zip and a stage on shared storage hold their own."""
    if str(scene).startswith(SHARED) or scene.suffix.lower() == ".zip":
        return {}
    images = {} if dome is None else {"dome": Path(dome)}
    if background is None:
        return images
    from primray.images.background import background_of

    behind = background_of(background)
    return images if behind is None or behind.file is None else {**images, "background": Path(behind.file)}


def uploaded_scene(
    client: Client, scene: Path, as_json: bool, images: Mapping[str, Path]
) -> tuple[Scene | str, str | None, dict[str, str]]:
    """Return the job's scene, its entry and the paths of its images; a stage on the service's shared storage is not
    uploaded."""
    if str(scene).startswith(SHARED):
        return str(scene), None, {}
    uploaded, packed, names = upload(client, scene, as_json, images)
    return uploaded, packed.entry, names


def upload(client: Client, scene: Path, as_json: bool, images: Mapping[str, Path]) -> tuple[Scene, SceneFile, dict[str, str]]:
    """Upload the scene, packed if necessary, unless the server has it."""
    with tempfile.TemporaryDirectory(prefix="primray-submit-") as scratch:
        try:
            packed, names = with_images(scene_file(scene, Path(scratch)), Path(scratch), images)
        except OSError as error:
            raise CommandError("unreadable-file", f"the scene cannot be packed: {error}", USAGE) from None
        for note in packed.notes:
            print(f"note: {plain(note)}", file=sys.stderr)
        try:
            with _showing(packed, as_json) as show:
                uploaded = _sent(client, packed, show)
        except KeyboardInterrupt:
            raise CommandError("interrupted", "nothing was submitted", INTERRUPTED) from None
    if uploaded.state == "rejected":
        refusal = error_of(uploaded.problem or {"detail": "the server rejected the scene"})
        exit_code = SCENE_REJECTED if refusal.exit_code == FAILED else refusal.exit_code
        raise CommandError(refusal.code, refusal.message, exit_code, where=refusal.where)
    return uploaded, packed, names


def _sent(client: Client, packed: SceneFile, show: Callable[[int, int], None]) -> Scene:
    """Upload by content if the scene has several files or is a large usdz, so that only files the server lacks are sent."""
    from ..client import ProblemError, UnexpectedAnswer
    from ..client.transfers import CUT_FROM_BYTES

    members = packed.members
    if members is None and packed.path.suffix.lower() == ".usdz" and packed.path.stat().st_size >= CUT_FROM_BYTES:
        members = {packed.name: packed.path}
    if members is not None:
        try:
            return client.upload_files(members, name=packed.name, show=show)
        except OSError as error:
            where = str(error.filename or "")
            raise CommandError("unreadable-file", f"it cannot be read: {error.strerror}", SCENE_REJECTED, where=where) from None
        except (ProblemError, UnexpectedAnswer) as error:
            if getattr(error, "status", 0) not in (404, 405):
                raise
        packed.write()  # an old server accepts whole packages only
    return client.upload(packed.path, name=packed.name, show=show)


@contextmanager
def _showing(packed: SceneFile, as_json: bool) -> Iterator[Callable[[int, int], None]]:
    if as_json or not sys.stderr.isatty():
        yield lambda done, of: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TransferSpeedColumn

    text = TextColumn("{task.description}", markup=False)
    with Progress(
        text, BarColumn(), DownloadColumn(), TransferSpeedColumn(), console=Console(stderr=True), transient=True
    ) as bar:
        task = bar.add_task(f"sending {packed.name}", total=None)
        yield lambda done, of: bar.update(task, completed=done, total=of)
