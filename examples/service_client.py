"""Over HTTP: send a stage to a service (`primray serve`), wait for its picture, fetch it. Standard library alone."""

import json
import os
import sys
import time
import urllib.request
from pathlib import Path

SERVER = os.environ.get("PRIMRAY_SERVER", "http://127.0.0.1:8700")
STAGE = Path(__file__).with_name("shot.usda")


def ask(path: str, data: bytes | None = None, kind: str = "application/json", **headers: str) -> bytes:
    request = urllib.request.Request(f"{SERVER}{path}", data, {"Content-Type": kind, **headers})
    if "PRIMRAY_API_KEY" in os.environ:
        request.add_header("Authorization", f"Bearer {os.environ['PRIMRAY_API_KEY']}")
    with urllib.request.urlopen(request) as answer:
        return answer.read()


def main(folder: Path) -> None:
    scene = json.loads(ask("/v1/scenes?name=shot.usda", STAGE.read_bytes(), "application/octet-stream"))
    settings = {"resolution": [240, 135], "stop": {"target_error": 0.05, "max_seconds": 60}}
    job = json.loads(ask("/v1/jobs", json.dumps({"scene": {"id": scene["id"]}, "settings": settings}).encode()))
    while job["state"] not in ("succeeded", "failed", "canceled", "expired"):
        time.sleep(0.2)
        job = json.loads(ask(f"/v1/jobs/{job['id']}"))
    print(job["id"], job["state"])
    if job["state"] != "succeeded":
        sys.exit(1)
    for output in json.loads(ask(f"/v1/jobs/{job['id']}/outputs"))["items"]:
        (folder / Path(output["name"]).name).write_bytes(ask(f"/v1/jobs/{job['id']}/outputs/{output['name']}"))
        print(output["name"])


if __name__ == "__main__":
    main(Path.cwd())
