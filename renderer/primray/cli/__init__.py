"""The command `primray`: one file per subcommand; this module turns errors into a message and an exit code.

Exit codes: 0 success, 1 render failed, 2 usage error, 3 scene refused, 4 a limit was exceeded, 5 the target error was not
reached, 6 a comparison is undecided, 130 interrupted (Ctrl-C, SIGTERM).
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any, NoReturn

from .. import process_memory
from ..errors import PrimrayError
from ..render.interruption import INTERRUPTED, end_at_once, install, interrupt
from . import lazy_dataclasses
from .console import exit_code_of, finish, make_lasting, print_error, print_json_error
from .foreign_command_lines import translate_foreign_flags
from .libraries_ahead import load_ahead
from .quick import render_arguments


def main() -> None:
    """Entry point of the console script."""
    install(interrupt)  # first, because pxr is imported later, and a signal before that must not be lost
    process_memory.owns_process = True
    arguments = sys.argv[1:]
    code = run(arguments, _start)
    install(end_at_once)  # everything is written
    if arguments[:1] != ["render"]:
        sys.exit(finish(code))
    _leave(code)


def _start() -> None:
    """Set up the process for fast imports; together these settings save a fifth of the import time."""
    # Imports create about 10^5 long-lived objects: scanning them for cyclic garbage at the default rate is most of that fifth.
    gc.set_threshold(200_000, 20, 20)
    sys.setdlopenflags(os.RTLD_LAZY)  # most functions of USD's libraries are never called
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads would spin during imports, and are not needed
    lazy_dataclasses.install()
    make_lasting()


def _leave(code: int) -> NoReturn:
    """Exit without cleanup, since destroying the stage, the scene and Python's objects takes as long as creating them did."""
    atexit._run_exitfuncs()
    os._exit(finish(code))


def run(arguments: list[str], start: Callable[[], None] = lambda: None) -> int:
    """Run one command line after `start`; return its exit code."""
    verbose, as_json = False, "--json" in arguments
    shown, warnings.showwarning = warnings.showwarning, partial(_show_warning, set(), warnings.showwarning)
    try:
        start()
        arguments = translate_foreign_flags(arguments)
        verbose = "-V" in arguments or "--verbose" in arguments
        _check_are_text(arguments)
        _call(arguments)
    except SystemExit as end:
        if _is_interrupt(end):
            print("interrupted", file=sys.stderr)
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except PrimrayError as error:
        return _fail(error, verbose, as_json)
    except Exception as error:
        if isinstance(error, OSError) and (known := _known(error)) is not None:
            return _fail(known, verbose, as_json)
        if not verbose:
            from ..core.native import unexpected

            error = unexpected(error, "this is a bug in primray; --verbose prints a traceback")
        return _fail(error, verbose, as_json)
    finally:
        warnings.showwarning = shown
    return 0


def _show_warning(
    told: set[str], others: Callable[..., None], message: Warning | str, category: type[Warning], *place: Any
) -> None:
    """Print diagnostics of a render that announces them as a program's user reads them, once, without a line of Python."""
    from ..diagnostic_messages import RenderWarning, without_place

    if not issubclass(category, RenderWarning):
        return others(message, category, *place)
    text = without_place(str(message))
    if text not in told:
        told.add(text)
        print(text, file=sys.stderr)


def _check_are_text(arguments: list[str]) -> None:
    """Raise SettingsError for an argument that is not UTF-8: the libraries that read and write files take no such names."""
    for word in arguments:
        if not word.isascii() and any("\ud800" <= letter <= "\udfff" for letter in word):
            from ..errors import SettingsError

            raise SettingsError("an argument is not valid UTF-8", where=word, code="not-utf8")


def _known(error: OSError) -> PrimrayError | None:
    """Return the error of a file name that is longer than file systems allow, of a full disk, or of missing permission; None
    for other errors."""
    from ..images.output_path import not_written, too_long

    where = str(error.filename or "")
    if isinstance(error, PermissionError) and where:
        return PrimrayError(f"this user may not use it: {error.strerror}", where=where, code="permission-denied")
    if isinstance(error, FileNotFoundError) and "temporary directory" in str(error):
        return PrimrayError("there is no folder for temporary files to write to: set TMPDIR", code="temporary-folder")
    return too_long(error, where) or not_written(error, where)


def _is_interrupt(end: SystemExit) -> bool:
    """Return whether Typer made this SystemExit from a KeyboardInterrupt."""
    error: BaseException | None = end
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _call(arguments: list[str]) -> None:
    plain = render_arguments(arguments)
    if plain is not None:
        if process_memory.owns_process:
            load_ahead()
        from .commands.render import render
        from .kept_inputs import run_keeping_inputs

        run_keeping_inputs(render, plain)
    else:
        from .app import app

        app(args=arguments, prog_name="primray", standalone_mode=True)


def _fail(error: Exception, verbose: bool, as_json: bool) -> int:
    if not verbose:
        return print_error(error, as_json)
    import traceback

    traceback.print_exception(error)
    return print_json_error(error) if as_json else exit_code_of(error)
