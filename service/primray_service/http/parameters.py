"""Parameters of a route by its handler's signature: of the path and the query, and what functions provide from the request.

A parameter of the type Request is the request. One that is annotated with `Provided` has what that function returns: the
service, the caller, a body. Any other is text in the path, if the path names it, or else in the query, and is validated as a
field of a pydantic model: `limit: Annotated[int, Field(ge=1, le=200)] = 50`.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ValidationError, create_model
from pydantic.fields import FieldInfo
from starlette.requests import Request

from ..api.aliases import hint_of
from ..problems import Problem
from .described import REF, Json


@dataclass(frozen=True)
class Provided:
    """Marks a parameter that `by` provides, which may be a coroutine function. `body` describes the request's body, if that is
    what is read; `problems` are those that reading it may raise."""

    by: Callable[[Request], Any]
    body: Json = field(default_factory=dict)
    problems: tuple[str, ...] = ()


class Parameters:
    """The parameters of one handler. Provided ones are determined first, in their order, so that a caller without a key learns
    nothing about the others."""

    def __init__(self, handler: Callable[..., Any], path_names: set[str]) -> None:
        hints = get_type_hints(handler, include_extras=True)
        texts: dict[str, Any] = {}
        self._path_names = path_names
        self._request: list[str] = []
        self.provided: dict[str, Provided] = {}
        for name, parameter in inspect.signature(handler).parameters.items():
            marks = [mark for mark in getattr(hints[name], "__metadata__", ()) if isinstance(mark, Provided)]
            if hints[name] is Request:
                self._request.append(name)
            elif marks:
                self.provided[name] = marks[0]
            else:
                texts[name] = (hints[name], ... if parameter.default is parameter.empty else parameter.default)
        in_order = sorted(texts, key=lambda name: name not in path_names)
        self._model: type[BaseModel] = create_model("Parameters", **{name: texts[name] for name in in_order})
        self._lists = {name for name in texts if _is_list(texts[name][0])}

    async def of(self, request: Request) -> dict[str, Any]:
        """Return the handler's arguments for this request; raises Problem if one is not valid."""
        arguments: dict[str, Any] = dict.fromkeys(self._request, request)
        for name, provided in self.provided.items():
            value = provided.by(request)
            arguments[name] = await value if inspect.isawaitable(value) else value
        try:
            return arguments | dict(self._model(**self._texts(request)))
        except ValidationError as error:
            # Further components of a location are indices of lists and branches of unions.
            raise invalid_request(error, lambda one: str(one["loc"][0]), part_of=self._place) from None

    def _texts(self, request: Request) -> dict[str, Any]:
        query, names = request.query_params, self._model.model_fields
        found = {name: query.getlist(name) if name in self._lists else query[name] for name in names if name in query}
        return found | request.path_params

    def _place(self, name: str) -> str:
        return "path" if name in self._path_names else "query"

    def described(self) -> list[Json]:
        """Return the parameters of the path and the query as OpenAPI describes them."""
        schemas = self._model.model_json_schema(ref_template=f"{REF}{{model}}").get("properties", {})
        return [self._described(name, field, schemas[name]) for name, field in self._model.model_fields.items()]

    def _described(self, name: str, field: FieldInfo, schema: Json) -> Json:
        if field.default is None:
            del schema["default"]  # the parameter is omitted: a query has no null
        described = {"name": name, "in": self._place(name), "required": field.is_required(), "schema": schema}
        return described if field.description is None else {**described, "description": field.description}


def _is_list(annotation: Any) -> bool:
    """Return whether a query may repeat the parameter: `list[...]`, or that or None."""
    if get_origin(annotation) is Annotated:
        annotation = get_args(annotation)[0]
    return any(get_origin(one) is list for one in (annotation, *get_args(annotation)))


def invalid_request(
    error: ValidationError,
    member_of: Callable[[Any], str],
    model: type[BaseModel] | None = None,
    part_of: Callable[[str], str] = lambda member: "",
) -> Problem:
    """Return the problem for everything that a model found wrong with a request, in a few words each, with hints; apart from
    names, nothing that was sent is repeated.

    `member_of` names the member or parameter of one of pydantic's errors, and `part_of` the part of the request that it is in,
    "" for the body.
    """
    details: dict[str, list[str]] = {}
    for one in error.errors(include_url=False)[:20]:
        details.setdefault(member_of(one), []).append(f"{one['msg']}{hint_of(one, model)}")
    errors = [
        {"member": member, **({"in": part} if (part := part_of(member)) else {}), "detail": one_of(texts)}
        for member, texts in details.items()
    ]
    first = errors[0]
    place = f"{first['member']} in the {first['in']}: " if "in" in first else f"{first['member']}: " if first["member"] else ""
    end = "" if first["detail"].endswith("?") else "."
    return Problem("invalid-request", f"{place}{first['detail']}{end}", member=first["member"], errors=errors)


def one_of(details: Sequence[str]) -> str:
    """Return one sentence from what the branches of a union report about one value."""
    first, *others = dict.fromkeys(details)
    return ", or ".join([first, *(detail.removeprefix("Input should be ") for detail in others)])
