"""A server that speaks S3 over HTTP, for tests: moto's, in a thread of this process, with an empty bucket for each that asks.

from tests.service.s3 import object_store_packages, s3_bucket, s3_server    (fixtures: import all)
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Iterator
from importlib.util import find_spec
from logging import getLogger

import pytest

ACCESS = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1"}


@pytest.fixture(scope="session")
def object_store_packages() -> None:
    """Skips the test where the packages of `primray[objects]` are absent."""
    if missing := [name for name in ("fsspec", "s3fs", "moto") if find_spec(name) is None]:
        pytest.skip(f"skipped: no {', '.join(missing)}")


@pytest.fixture(scope="session")
def s3_server(object_store_packages: None) -> Iterator[str]:
    """Its URL; boto's environment variables lead to it, in servers that are started too."""
    from moto.server import ThreadedMotoServer

    getLogger("werkzeug").setLevel("ERROR")
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    before = dict(os.environ)
    os.environ.update(ACCESS, AWS_ENDPOINT_URL=f"http://{host}:{port}")
    yield os.environ["AWS_ENDPOINT_URL"]
    os.environ.clear()
    os.environ.update(before)
    server.stop()


@pytest.fixture(scope="module")
def s3_bucket(s3_server: str) -> str:
    """The URL of a prefix in it."""
    import boto3

    name = f"primray-{uuid.uuid4().hex[:12]}"
    boto3.client("s3").create_bucket(Bucket=name)
    return f"s3://{name}/studio"
