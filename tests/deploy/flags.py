"""Whether flags that files of deploy/ name are there."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from primray_service.cli.limit_options import limits_of
from primray_service.cli.serve import serve
from primray_service.config import LABEL
from primray_service.executor.base import DEFAULT_EXECUTOR, check_executor_name


def flags_of(words: Sequence[str]) -> dict[str, str]:
    """`--name value` and `--name=value`; "" for a flag without a value."""
    found: dict[str, str] = {}
    last = ""
    for word in words:
        if word.startswith("--"):
            last, _, found_value = word.partition("=")
            found[last] = found_value
        else:
            assert not found[last], word
            found[last] = word
    return found


def check_serve_flags(words: Sequence[str]) -> None:
    """Each is one of `primray serve`, and means something."""
    import typer
    from typer.main import get_command

    app = typer.Typer()
    app.command()(serve)
    get_command(app).make_context("serve", [*words])
    flags = flags_of(words)
    limits_of([flags["--limit"]] if "--limit" in flags else [])
    check_executor_name(flags.get("--executor", DEFAULT_EXECUTOR))
    assert LABEL.fullmatch(flags.get("--ray-label", "a=b"))


def check_ray_flags(words: Sequence[str]) -> None:
    """Each is one of `ray start`."""
    scripts = pytest.importorskip("ray.scripts.scripts")
    known = {name: option for option in scripts.start.params for name in option.opts}
    for name, value in flags_of(words).items():
        assert name in known, name
        assert known[name].is_flag == (value == "") or value in ("true", "false"), name
