"""The command `primray`: one file per subcommand; this one turns errors into a line and an exit code.

Exit codes: 0 done, 1 render failed, 2 usage, 3 scene rejected, 4 a limit was reached, 5 ended above the target error,
130 interrupted (Ctrl-C, SIGTERM).
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
from contextlib import suppress
from typing import NoReturn

from ..errors import InternalError, PrimrayError
from .quick import render_arguments


def main() -> None:
    """Entry point of the console script."""
    _start()
    arguments = sys.argv[1:]
    code = run(arguments)
    if render_arguments(arguments) is None:
        sys.exit(code)
    _leave(code)


def _start() -> None:
    """Set what makes imports quicker; all of it together takes a fifth of their time."""
    # Some 10^5 objects are made that stay: searching them for cyclic garbage at the usual pace is most of that fifth.
    gc.set_threshold(200_000, 20, 20)
    sys.setdlopenflags(os.RTLD_LAZY)  # thousands of functions of USD's libraries are never called
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads would spin beside the imports; nothing here needs them


def _leave(code: int) -> NoReturn:
    """End at once. What is written is written; taking the stage, the scene and Python apart piece by piece takes as long as
    opening them did."""
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


def run(arguments: list[str]) -> int:
    """Run one command line; its exit code."""
    verbose = "-V" in arguments or "--verbose" in arguments
    try:
        plain = render_arguments(arguments)
        if plain is not None:
            from .commands.render import render

            render(**plain)
        else:
            from .app import app

            app(args=arguments, prog_name="primray", standalone_mode=True)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    except PrimrayError as error:
        return _fail(error, verbose, "--json" in arguments)
    except Exception as error:
        if not verbose:
            hint = "this is a defect in primray; --verbose prints where"
            error = InternalError(f"{type(error).__name__}: {error} ({hint})")
        return _fail(error, verbose, "--json" in arguments)
    return 0


def _fail(error: Exception, verbose: bool, as_json: bool) -> int:
    if verbose:
        import traceback

        traceback.print_exception(error)
    else:
        print(f"error: {error}", file=sys.stderr)
    code, exit_code = (error.code, error.exit_code) if isinstance(error, PrimrayError) else ("internal", 1)
    if as_json:
        from .json_lines import print_line

        message, where = (error.message, error.where) if isinstance(error, PrimrayError) else (str(error), "")
        print_line({"type": "error", "code": code, "message": message, "where": where, "exit_code": exit_code})
    return exit_code
