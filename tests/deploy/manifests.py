"""The files of deploy/ as data, and the pods that would come of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml  # type: ignore[import-untyped]

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "deploy/kubernetes"
FILES = sorted(FOLDER.glob("*.yaml"))
NAMESPACE = "primray"


@dataclass(frozen=True)
class Pod:
    name: str
    labels: dict[str, str]
    spec: dict[str, Any]

    def containers(self) -> list[dict[str, Any]]:
        return [*self.spec.get("initContainers", ()), *self.spec["containers"]]


@cache
def documents() -> list[dict[str, Any]]:
    return [document for file in FILES for document in yaml.safe_load_all(file.read_text())]


def of_kind(kind: str) -> list[dict[str, Any]]:
    return [document for document in documents() if document["kind"] == kind]


def one(kind: str) -> Any:
    (found,) = of_kind(kind)
    return found


def pods() -> dict[str, Pod]:
    found = {}
    for workload in (*of_kind("Deployment"), *of_kind("StatefulSet")):
        template = workload["spec"]["template"]
        found[workload["metadata"]["name"]] = Pod(
            workload["metadata"]["name"], template["metadata"]["labels"], template["spec"]
        )
    return found | {pod.name: pod for pod in _ray_pods(one("RayCluster"))}


def _ray_pods(cluster: dict[str, Any]) -> Iterator[Pod]:
    """With the labels that KubeRay adds, and the container of its autoscaler in the head's pod."""
    spec = cluster["spec"]
    groups = [("head", spec["headGroupSpec"])] + [("worker", group) for group in spec["workerGroupSpecs"]]
    for kind, group in groups:
        name = group.get("groupName", "head")
        own = {"ray.io/cluster": cluster["metadata"]["name"], "ray.io/node-type": kind, "ray.io/group": name}
        inside = dict(group["template"]["spec"])
        if kind == "head":
            image = inside["containers"][0]["image"]
            inside["containers"] = [*inside["containers"], {"name": "autoscaler", "image": image, **spec["autoscalerOptions"]}]
        yield Pod(name, {**group["template"]["metadata"]["labels"], **group.get("labels", {}), **own}, inside)
