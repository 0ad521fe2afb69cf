"""`primray mcp`: an eye for agents, by the Model Context Protocol."""

from __future__ import annotations

import asyncio
import os
import socket
import sys
import tempfile
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from primray.cli import option_values
from primray.errors import SettingsError

from ..cli.exits import CommandError

EXTRA = ("mcp", "pydantic", "uvicorn")
ADDRESS = "127.0.0.1"
MEMORY_SHARE = 0.5  # of the machine's, unless --max-memory says otherwise


def mcp(
    root: Annotated[
        list[Path] | None,
        typer.Option("--root", metavar="DIR", help="Folder with stages; may be repeated.", show_default="this folder"),
    ] = None,
    output_dir: Annotated[
        Path | None,
        typer.Option("--output-dir", metavar="DIR", help="Folder that `render` writes to.", show_default="a temporary one"),
    ] = None,
    http: Annotated[bool, typer.Option("--http", help="Serve HTTP on this machine instead of stdin and stdout.")] = False,
    port: Annotated[int, typer.Option(metavar="N", help="Port of --http.", min=1, max=65535)] = 8765,
    max_memory: Annotated[
        str | None,
        typer.Option("--max-memory", metavar="SIZE", help="Memory of all scenes together.", show_default="half the machine's"),
    ] = None,
    max_seconds: Annotated[float, typer.Option(metavar="S", help="Most seconds of one `render`.", min=0.1)] = 60.0,
    threads: Annotated[int | None, typer.Option(metavar="N", help="Threads of a scene.", show_default="all", min=1)] = None,
) -> None:
    """Show stages to agents: tools of the Model Context Protocol that look, compare, inspect and render."""
    missing = [name for name in EXTRA if find_spec(name) is None]
    if missing:
        sentence = "`primray mcp` needs the extra `mcp`; install it with: pip install 'primray[mcp]'"
        raise CommandError("extra-missing", sentence, where=", ".join(missing))
    from ..sandbox import works
    from .scene_processes import SceneLimits
    from .server import Access, create_server, serve

    if not works():
        sentence = "stages are opened in a sandbox only, and neither Landlock nor bubblewrap with seccomp works here"
        raise CommandError("no-sandbox", sentence)
    roots = tuple(_folder(path, "root") for path in root or [Path()])
    memory = option_values.bytes_of(max_memory) or int(MEMORY_SHARE * _machine_bytes())
    with tempfile.TemporaryDirectory(prefix="primray-renders-") as made:
        output = Path(made) if output_dir is None else _made(output_dir)
        access = Access(roots=roots, output=output, most_seconds=max_seconds)
        limits = SceneLimits(memory_bytes=memory, threads=threads or len(os.sched_getaffinity(0)))
        listener = _listener(port) if http else None
        if listener is not None:
            print(f"primray shows stages to agents at http://{ADDRESS}:{port}/mcp", file=sys.stderr, flush=True)
        with suppress(KeyboardInterrupt):  # a signal is how a server ends
            asyncio.run(serve(create_server(access, limits), listener))


def _listener(port: int) -> socket.socket:
    try:
        return socket.create_server((ADDRESS, port))
    except OSError as error:
        sentence = f"port {port} of {ADDRESS} cannot be listened on: {os.strerror(error.errno or 0)}"
        raise CommandError("port", sentence, where="port") from None


def _folder(path: Path, where: str) -> Path:
    found = Path(os.path.realpath(path))
    if not found.is_dir() or found == Path("/"):
        problem = "does not exist" if not found.exists() else "is no folder" if not found.is_dir() else "may not be all files"
        raise SettingsError(f"{path} {problem}", where=where, code="root")
    return found


def _made(path: Path) -> Path:
    """Return the folder of renders, which is made where it is missing, as the folder of `primray render -o` is."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SettingsError(f"{path} cannot be made: {error.strerror}", where="output_dir", code="root") from None
    return _folder(path, "output_dir")


def _machine_bytes() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
