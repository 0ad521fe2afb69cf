"""The command `primray`: one file per subcommand; this one turns errors into a line and an exit code.

Exit codes: 0 done, 1 render failed, 2 usage, 3 scene rejected, 4 a limit was reached, 5 ended above the target error,
6 a comparison is undecided, 130 interrupted (Ctrl-C, SIGTERM).
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Callable
from typing import NoReturn

from .. import process_memory
from ..errors import InternalError, PrimrayError
from ..render.interruption import INTERRUPTED, end_at_once, install, interrupt
from .habits.command_line import without_habits
from .quick import render_arguments
from .terminal.errors import exit_code_of, print_error, print_json_error
from .terminal.streams import finish, make_lasting


def main() -> None:
    """Entry point of the console script."""
    install(interrupt)  # first: pxr is imported later, and a signal in between is not to be lost
    process_memory.owns_process = True
    arguments = sys.argv[1:]
    code = run(arguments, _start)
    install(end_at_once)  # all is written
    if arguments[:1] != ["render"]:
        sys.exit(finish(code))
    _leave(code)


def _start() -> None:
    """Set what makes imports quicker; all of it together takes a fifth of their time."""
    # Some 10^5 objects are made that stay: searching them for cyclic garbage at the usual pace is most of that fifth.
    gc.set_threshold(200_000, 20, 20)
    sys.setdlopenflags(os.RTLD_LAZY)  # thousands of functions of USD's libraries are never called
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads would spin beside the imports; nothing here needs them
    make_lasting()


def _leave(code: int) -> NoReturn:
    """End at once. What is written is written; taking the stage, the scene and Python apart piece by piece takes as long as
    opening them did."""
    atexit._run_exitfuncs()
    os._exit(finish(code))


def run(arguments: list[str], start: Callable[[], None] = lambda: None) -> int:
    """Run one command line after `start`; its exit code."""
    verbose, as_json = False, "--json" in arguments
    try:
        start()
        arguments = without_habits(arguments)
        verbose = "-V" in arguments or "--verbose" in arguments
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
        if isinstance(error, OSError) and (known := _too_long(error)) is not None:
            return _fail(known, verbose, as_json)
        if not verbose:
            hint = "this is a defect in primray; --verbose prints where"
            error = InternalError(f"{type(error).__name__}: {error} ({hint})")
        return _fail(error, verbose, as_json)
    return 0


def _too_long(error: OSError) -> PrimrayError | None:
    """Return the error of a file that the command line names by more than file systems hold."""
    from ..images.output_path import too_long

    return too_long(error, str(error.filename or ""))


def _is_interrupt(end: SystemExit) -> bool:
    """Return whether Typer made this end from a KeyboardInterrupt, without a word."""
    error: BaseException | None = end
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _call(arguments: list[str]) -> None:
    plain = render_arguments(arguments)
    if plain is not None:
        from .commands.render import render

        render(**plain)
    else:
        from .app import app

        app(args=arguments, prog_name="primray", standalone_mode=True)


def _fail(error: Exception, verbose: bool, as_json: bool) -> int:
    if not verbose:
        return print_error(error, as_json)
    import traceback

    traceback.print_exception(error)
    return print_json_error(error) if as_json else exit_code_of(error)
