"""Routes: handlers with their paths, parameters and descriptions of their answers, from which openapi.py makes the document.

    router = Router("/v1/jobs", resource="jobs", tag="jobs")

    @router.get("/{job_id}", answer(views.Job), problems=("not-found",))
    def show(job_id: JobId, caller: Reader, service: Serving) -> Response:

`def` handlers run in threads, `async def` ones in the event loop. Handlers make their answers themselves: the descriptions are
compared with what is sent by tests. A route without answers is not in the document.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypedDict, TypeVar, Unpack

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Match, Route
from starlette.types import Receive, Scope, Send

from .callers import spend_request
from .described import Answer, Json
from .parameters import Parameters

Handler = TypeVar("Handler", bound=Callable[..., Any])
LIMITED = "/v1"  # paths below it take a token of the caller's request rate


class Description(TypedDict, total=False):
    """What the document says of an operation, beside its parameters and answers."""

    problems: Sequence[str]  # that are not possible everywhere under /v1
    request: Json  # a body that is not JSON of a model
    headers: Sequence[str]  # of the request: names in REQUEST_HEADERS


class Operation(Route):
    """A method of a path, with its handler and its description."""

    def __init__(
        self, method: str, path: str, handler: Callable[..., Any], router: Router, answers: Sequence[Answer], more: Description
    ) -> None:
        super().__init__(path, self._answer, methods=[method], name=handler.__name__, include_in_schema=bool(answers))
        self.method, self.handler, self.answers = method, handler, answers
        self.tag, self._resource = router.tag, router.resource
        self.parameters = Parameters(handler, set(self.param_convertors))
        self.headers: Sequence[str] = more.get("headers", ())
        self.problems: list[str] = list(more.get("problems", ()))
        self.body: Json = dict(more.get("request", {}))
        for provided in self.parameters.provided.values():
            self.problems[:0] = provided.problems
            self.body |= provided.body
        self._is_limited = path.startswith(LIMITED)
        self._is_async = inspect.iscoroutinefunction(handler)

    @property
    def id(self) -> str:
        """The operation's id, resource and action: jobs_show, admin_jobs_show."""
        return f"{self._resource}_{self.name}"

    async def _answer(self, request: Request) -> Response:
        if self._is_limited:
            await spend_request(request)
        arguments = await self.parameters.of(request)
        answer: Response
        if self._is_async:
            answer = await self.handler(**arguments)
        else:
            answer = await run_in_threadpool(self.handler, **arguments)
        return answer

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        scope["route"] = self
        await super().handle(scope, receive, send)


class Router:
    """The operations of one resource, below a common path; `tag` is their section of the document."""

    def __init__(self, prefix: str = "", *, resource: str, tag: str = "") -> None:
        self.operations: list[Operation] = []
        self.resource, self.tag = resource, tag
        self._prefix = prefix

    def get(self, path: str, *answers: Answer, **more: Unpack[Description]) -> Callable[[Handler], Handler]:
        return self._route("GET", path, answers, more)

    def post(self, path: str, *answers: Answer, **more: Unpack[Description]) -> Callable[[Handler], Handler]:
        return self._route("POST", path, answers, more)

    def put(self, path: str, *answers: Answer, **more: Unpack[Description]) -> Callable[[Handler], Handler]:
        return self._route("PUT", path, answers, more)

    def patch(self, path: str, *answers: Answer, **more: Unpack[Description]) -> Callable[[Handler], Handler]:
        return self._route("PATCH", path, answers, more)

    def delete(self, path: str, *answers: Answer, **more: Unpack[Description]) -> Callable[[Handler], Handler]:
        return self._route("DELETE", path, answers, more)

    def _route(self, method: str, path: str, answers: Sequence[Answer], more: Description) -> Callable[[Handler], Handler]:
        def add(handler: Handler) -> Handler:
            self.operations.append(Operation(method, self._prefix + path, handler, self, answers, more))
            return handler

        return add


def path_of(routes: Iterable[BaseRoute], scope: Scope) -> str:
    """Return the path of the first route that matches a request, with its parameters' names; "" if none does."""
    return next((route.path for route in routes if isinstance(route, Route) and route.matches(scope)[0] is not Match.NONE), "")
