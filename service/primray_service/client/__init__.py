"""A Python client of the service, typed and synchronous.

    from primray_service.client import Client

    with Client("http://127.0.0.1:8700") as client:
        scene = client.upload("shot.usdz")
        job = client.submit(scene, settings={"stop": {"target_error": 0.01}})
        job = client.wait(job.id)
        for output in client.outputs(job.id):
            client.download(job.id, output, "pictures")

    client.py     what can be asked, one method each; admin.py: what an administrator can ask
    documents.py  what is answered and sent, as dataclasses
    reading.py    JSON into those; answers.py: answers that are JSON
    transport.py  one request: tried again where that is safe, its errors as exceptions
    events.py     server-sent events, through broken connections
    upload.py     packages by content: only files that the server lacks
    download.py   files, gone on with where they broke off, checked against their digest
    errors.py     what is raised

tests/service/client/test_contract.py holds it to schemas/openapi.json.
"""

from __future__ import annotations

from .admin import Administration
from .client import Client
from .documents import (
    Convergence,
    Event,
    Frame,
    Job,
    Key,
    Output,
    Progress,
    QueuePlace,
    RunningFrame,
    Scene,
    TenantUsage,
    Usage,
    WorkerNode,
    Workers,
)
from .errors import ClientError, DigestMismatch, ProblemError, ServerUnreachable, TimedOut, UnexpectedAnswer

__all__ = [
    "Administration",
    "Client",
    "ClientError",
    "Convergence",
    "DigestMismatch",
    "Event",
    "Frame",
    "Job",
    "Key",
    "Output",
    "ProblemError",
    "Progress",
    "QueuePlace",
    "RunningFrame",
    "Scene",
    "ServerUnreachable",
    "TenantUsage",
    "TimedOut",
    "UnexpectedAnswer",
    "Usage",
    "WorkerNode",
    "Workers",
]
