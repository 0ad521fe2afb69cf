"""Helpers of the client: paths of jobs, and answers that are JSON."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

from .documents import Json
from .errors import UnexpectedAnswer


def job_path(job_id: str) -> str:
    return f"/v1/jobs/{quote(job_id, safe='')}"


def json_of(answer: Any) -> Any:
    try:
        return answer.json()
    except ValueError:
        raise UnexpectedAnswer(f"{answer.request.url} answered {answer.status_code} without JSON") from None


def object_of(document: Any) -> Json:
    if not isinstance(document, dict):
        raise UnexpectedAnswer("a JSON object was expected")
    return document


def items_of(page: Any) -> list[Any]:
    items = page.get("items") if isinstance(page, dict) else page
    if not isinstance(items, list):
        raise UnexpectedAnswer("a list was expected")
    return items
