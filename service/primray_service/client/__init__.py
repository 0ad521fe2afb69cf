"""A Python client of the service, typed and synchronous.

    from primray_service.client import Client

    with Client("http://127.0.0.1:8700") as client:
        scene = client.upload("shot.usdz")
        job = client.submit(scene, settings={"stop": {"target_error": 0.01}})
        job = client.wait(job.id)
        for output in client.outputs(job.id):
            client.download(job.id, output, "pictures")

    client.py     requests, one method each; admin.py: those of an administrator
    documents.py  documents that are sent and answered, as dataclasses, and how JSON is read into them; settings.py: generated
    transport.py  one request: repeated where that is safe, its errors as exceptions; server-sent events
    transfers.py  uploads of packages by content, only files that the server lacks; downloads, resumed and checked
    errors.py     exceptions

tests/service/client/test_documents_contract.py compares it with schemas/openapi.json.
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
