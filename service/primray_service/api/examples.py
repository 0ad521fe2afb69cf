"""Examples of API requests with curl and Python's standard library. Path parameters are variables of the same names."""

from __future__ import annotations

import json
import re

from .operations import Body, Operation

SERVER = "http://127.0.0.1:8700"
# answers that are saved as a file
FILES = {"previews_preview": "preview.png", "outputs_output": "beauty.exr", "logs_log": "log.txt"}
SENT = "shot.usda"


def curl_example(operation: Operation) -> str:
    options = {"GET": "", "POST": "", "HEAD": " -I"}.get(operation.method, f" -X {operation.method}")
    body = _body(operation)
    if operation.method == "POST" and body is None:
        options = " -X POST"
    lines = [f'curl -sS{options} "{_url(operation, "$")}"']
    if body is not None and body.example is None:
        lines.append(f"  -H 'Content-Type: {body.media_type}' --data-binary @{SENT}")
    elif body is not None:
        lines.append(f"  -H 'Content-Type: {body.media_type}' -d '{json.dumps(body.example)}'")
    if operation.key in FILES:
        lines.append(f"  -o {FILES[operation.key]}")
    return " \\\n".join(lines)


def python_example(operation: Operation) -> str:
    url, body = _url(operation, ""), _body(operation)
    asked = [f'{"f" if "{" in url else ""}"{url}"']
    imports = ["from urllib.request import Request, urlopen"]
    if operation.method != "GET":
        asked.append(f'method="{operation.method}"')
    if body is not None:
        asked.append(f'headers={{"Content-Type": "{body.media_type}"}}')
        if body.example is None:
            asked.append(f'data=Path("{SENT}").read_bytes()')
            imports.insert(0, "from pathlib import Path")
        else:
            asked.append(f"data=json.dumps({body.example}).encode()")
    if operation.key in FILES:
        shown = f'    Path("{FILES[operation.key]}").write_bytes(answer.read())'
        imports.insert(0, "from pathlib import Path")
    elif _answers_json(operation):
        shown = "    print(answer.status, json.load(answer))"
    elif operation.method == "HEAD" or operation.answers[0].status == "204":
        shown = "    print(answer.status, answer.headers)"
    else:
        shown = "    print(answer.status, answer.read().decode())"
    if "json." in f"{asked}{shown}":
        imports.insert(0, "import json")
    request = f"Request({asked[0]})" if len(asked) == 1 else "Request(\n    " + ",\n    ".join(asked) + ",\n)"
    return "\n".join([*imports, "", f"request = {request}", "with urlopen(request) as answer:", shown])


def _body(operation: Operation) -> Body | None:
    """Return the operation's body, JSON if possible; a file body of a media type that any file has."""
    found = [body for body in operation.bodies if body.example is not None]
    found += [body for body in operation.bodies if body.media_type == "application/octet-stream"]
    return found[0] if found else None


def _url(operation: Operation, sign: str) -> str:
    path = re.sub(r"\{(\w+)\}", rf"{sign}\1" if sign else r"{\1}", operation.path)
    query = f"?name={SENT}" if operation.key == "scenes_upload" else ""
    return f"{SERVER}{path}{query}"


def _answers_json(operation: Operation) -> bool:
    """Return whether the operation answers JSON to a request without an Accept header."""
    return operation.method != "HEAD" and "application/json" in operation.answers[0].media_types
