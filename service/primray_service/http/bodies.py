"""JSON bodies: read up to a limit, and validated against a model; duplicate names and invalid numbers are refused."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from starlette.requests import ClientDisconnect, Request

from ..api.aliases import in_own_words
from ..problems import Problem
from .callers import service_of
from .described import json_request
from .parameters import Provided, invalid_request

Model = TypeVar("Model", bound=BaseModel)
MORE_BYTES = 2**20
PROBLEMS = ("invalid-json", "request-too-large", "unsupported-media-type", "invalid-request")
AS_IT_IS = {"accept-encoding": "identity"}
MOST_EXACT = 2**53  # doubles hold every integer up to this
MAX_DIGITS = 40  # of an integer: longer ones are refused before conversion


def json_body(model: type[Model], example: Any = None, *, may_lack: bool = False, limit: str = "json_bytes") -> Provided:
    """Mark a parameter that is the body as this model; `may_lack`: no body counts as {}; `limit`: the limit on its bytes."""

    async def body(request: Request) -> Model:
        return model() if may_lack and has_no_body(request) else await read_json(request, model, limit)

    return Provided(body, json_request(model, example, required=not may_lack), PROBLEMS)


async def read_json(request: Request, model: type[Model], limit: str = "json_bytes") -> Model:
    check_json_type(request)
    return parsed(model, await read(request, getattr(service_of(request).limits, limit)))


def has_no_body(request: Request) -> bool:
    """Return whether the request has no body: RFC 9112, 6.3 announces one by either of these headers."""
    return request.headers.get("content-length", "0") == "0" and "transfer-encoding" not in request.headers


def check_json_type(request: Request) -> None:
    media_type, _, parameters = request.headers.get("content-type", "").partition(";")
    charset = parameters.lower().replace(" ", "").replace('"', "")
    if media_type.strip().lower() != "application/json" or charset not in ("", "charset=utf-8"):
        raise Problem(
            "unsupported-media-type", "The body must be application/json, in UTF-8.", headers={"accept": "application/json"}
        )
    if request.headers.get("content-encoding", "identity").strip().lower() not in ("", "identity"):
        raise Problem("unsupported-media-type", "JSON is accepted only without a Content-Encoding.", headers=AS_IT_IS)


async def read(request: Request, most_bytes: int) -> bytes:
    """Return the body; its bytes are counted, whatever Content-Length says.

    Of a body that is too large a little more is read: a connection that is closed with bytes unread is reset, and the client
    would see that instead of the answer.
    """
    body, size = bytearray(), 0
    try:
        async for part in request.stream():
            size += len(part)
            if size <= most_bytes:
                body += part
            elif size > most_bytes + MORE_BYTES:
                break
    except ClientDisconnect:
        raise Problem("upload-incomplete", "The connection ended before the body did.") from None
    if size > most_bytes:
        close = {"connection": "close"}
        raise Problem("request-too-large", f"The JSON may have at most {most_bytes} bytes.", headers=close, limit=most_bytes)
    request.state.body_was_read = True
    return bytes(body)


def parsed(model: type[Model], body: bytes, where: str = "") -> Model:
    """Return the model; raises Problem with the member at fault, below `where`."""
    document = check_json(body)
    meant = _with_whole_numbers(in_own_words(document))
    try:
        return model.model_validate_json(body if meant is document else json.dumps(meant))
    except ValidationError as error:
        raise invalid(error, where, model, meant) from None


def _with_whole_numbers(value: Any) -> Any:
    """Return the value with 16 for 16.0, or the same object if there is none: JSON has one kind of number, and JSON Schema
    calls those without a fraction integers. Members of type number accept 16 as well."""
    if isinstance(value, float):
        return int(value) if value.is_integer() and abs(value) < MOST_EXACT else value
    if isinstance(value, dict):
        members = {name: _with_whole_numbers(member) for name, member in value.items()}
        return members if any(members[name] is not member for name, member in value.items()) else value
    if isinstance(value, list):
        items = [_with_whole_numbers(item) for item in value]
        return items if any(a is not b for a, b in zip(items, value, strict=True)) else value
    return value


def check_json(body: bytes) -> Any:
    """Return the value. Refuses what pydantic lets pass: duplicate names, NaN, numbers of many digits; and NUL, which
    PostgreSQL cannot store."""
    try:
        value = json.loads(
            body.decode("utf-8"), object_pairs_hook=_members, parse_constant=_no_constant, parse_int=_whole, parse_float=_finite
        )
        _check_text(value)
        return value
    except UnicodeDecodeError as error:
        raise Problem("invalid-json", f"The body is not UTF-8 at byte {error.start}.") from None
    except RecursionError:
        raise Problem("invalid-json", "The JSON is nested too deeply.") from None
    except json.JSONDecodeError as error:
        raise Problem("invalid-json", f"{error.msg} at line {error.lineno}, column {error.colno}.") from None


def _members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise Problem("invalid-json", f"The member {twice[:100]!r} occurs twice.")
    return members


def _no_constant(name: str) -> None:
    raise Problem("invalid-json", f"{name} is not a JSON number.")


def _whole(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise Problem("invalid-json", f"A number has {len(digits)} digits.")
    return int(digits)


def _finite(text: str) -> float:
    value = float(text)
    if value in (float("inf"), float("-inf")):
        raise Problem("invalid-json", f"{text[:40]} is too large for a number.")
    return value


def _check_text(value: Any) -> None:
    if isinstance(value, str):
        if "\0" in value or any("\ud800" <= char <= "\udfff" for char in value):
            raise Problem("invalid-json", "A text contains NUL, or half of a surrogate pair.")
    elif isinstance(value, dict):
        for name, member in value.items():
            _check_text(name)
            _check_text(member)
    elif isinstance(value, list):
        for member in value:
            _check_text(member)


def invalid(error: ValidationError, where: str = "", model: type[BaseModel] | None = None, document: Any = None) -> Problem:
    """Return the problem for everything that the model found wrong with the document, whose place in the body is `where`."""
    return invalid_request(error, lambda found: ".".join([where] * bool(where) + _place(found, document)), model)


def _place(found: Mapping[str, Any], document: Any) -> list[str]:
    """Return the components of a member's path in the document: pydantic inserts the branches of a union."""
    *above, last = found["loc"] or ("",)
    parts, value = [], document
    for part in above:
        if _has(value, part):
            parts.append(str(part)[:100])
            value = value[part]
    return [*parts, str(last)[:100]] if found["type"] == "missing" or _has(value, last) else parts


def _has(value: Any, part: int | str) -> bool:
    return part in value if isinstance(value, dict) else isinstance(value, list) and isinstance(part, int)
