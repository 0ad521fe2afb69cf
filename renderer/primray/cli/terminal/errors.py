"""Error output of a command: a line on stderr, and a JSON line on stdout if requested."""

from __future__ import annotations

import sys

from ...errors import InternalError, PrimrayError, UnsupportedError

_MOST_LINES = 40  # lines of refused diagnostics


def print_error(error: Exception, as_json: bool) -> int:
    """Print an error, preceded by the diagnostics that it refuses if there are several; return its exit code."""
    if isinstance(error, UnsupportedError) and len(error.refused) > 1:
        from ...notices.diagnostics_text import diagnostics_lines

        lines = diagnostics_lines(error.refused, verbose=True)
        more = [f"and {len(lines) - _MOST_LINES:,} more lines"] if len(lines) > _MOST_LINES else []
        print(*lines[:_MOST_LINES], *more, sep="\n", file=sys.stderr)
    print(f"error: {error}", file=sys.stderr)
    return print_json_error(error) if as_json else exit_code_of(error)


def print_json_error(error: Exception) -> int:
    from ..json_lines import print_line

    known = error if isinstance(error, PrimrayError) else InternalError(str(error))
    code, message, where = known.code, known.message, known.where
    print_line({"type": "error", "code": code, "message": message, "where": where, "exit_code": exit_code_of(error)})
    return exit_code_of(error)


def exit_code_of(error: Exception) -> int:
    return error.exit_code if isinstance(error, PrimrayError) else 1
