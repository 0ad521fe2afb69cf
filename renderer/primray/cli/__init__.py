"""The command `primray`: one file per subcommand; this one turns errors into a line and an exit code.

Exit codes: 0 done, 1 render failed, 2 usage, 3 scene rejected, 4 a limit was reached, 5 ended above the target error,
130 interrupted (Ctrl-C, SIGTERM).
"""

from __future__ import annotations

import sys
import traceback

from ..errors import InternalError, PrimrayError


def main() -> None:
    """Entry point of the console script."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command line; its exit code."""
    from .app import app

    verbose = "-V" in arguments or "--verbose" in arguments
    try:
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
        traceback.print_exception(error)
    else:
        print(f"error: {error}", file=sys.stderr)
    code, exit_code = (error.code, error.exit_code) if isinstance(error, PrimrayError) else ("internal", 1)
    if as_json:
        from .json_lines import print_line

        message, where = (error.message, error.where) if isinstance(error, PrimrayError) else (str(error), "")
        print_line({"type": "error", "code": code, "message": message, "where": where, "exit_code": exit_code})
    return exit_code
