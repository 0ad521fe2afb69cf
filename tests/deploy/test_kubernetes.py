"""deploy/kubernetes: valid by the schemas of Kubernetes and KubeRay, careful, in agreement with itself and with the sources."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

from .flags import check_ray_flags, check_serve_flags, flags_of
from .go_modules import KUBERAY, KUBERAY_SUM, module_folder
from .manifests import FILES, NAMESPACE, ROOT, documents, of_kind, one, pods

PODS = ["database", "server", "head", "render"]
IMAGE = "registry.example/primray:ray"
RUNBOOK = (ROOT / "docs/service/scaling.md").read_text()


def strict(schema: Any) -> Any:
    """As the API server's strict validation: what a schema does not name is an error."""
    if isinstance(schema, list):
        return [strict(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    found = {name: strict(each) for name, each in schema.items()}
    if isinstance(found.get("properties"), dict) and "additionalProperties" not in found and found.get("type") == "object":
        found["additionalProperties"] = found.get("x-kubernetes-preserve-unknown-fields", False)
    return found


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_kubernetes_takes_it(file: Any) -> None:
    validator = pytest.importorskip("kubernetes_validate")
    for document in yaml.safe_load_all(file.read_text()):
        if document["apiVersion"] != "ray.io/v1":
            validator.validate(document, validator.latest_version(), strict=True)
            with pytest.raises(validator.ValidationError):
                validator.validate({**document, "spce": {}}, validator.latest_version(), strict=True)


def test_kuberay_takes_the_cluster() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    definition = module_folder(KUBERAY, KUBERAY_SUM) / "config/crd/bases/ray.io_rayclusters.yaml"
    versions = {each["name"]: each for each in yaml.load(definition.read_text(), yaml.CSafeLoader)["spec"]["versions"]}
    schema = strict(versions["v1"]["schema"]["openAPIV3Schema"])
    schema["properties"]["metadata"] = {"type": "object"}
    cluster = one("RayCluster")
    jsonschema.validate(cluster, schema)
    wrong = json.loads(json.dumps(cluster))
    wrong["spec"]["headGroupSpec"]["template"]["spec"]["containers"][0]["imge"] = ""
    with pytest.raises(jsonschema.ValidationError, match="imge"):
        jsonschema.validate(wrong, schema)


def test_everything_is_in_the_one_namespace() -> None:
    assert one("Namespace")["metadata"]["name"] == NAMESPACE
    for document in documents():
        assert document["kind"] == "Namespace" or document["metadata"]["namespace"] == NAMESPACE
    assert one("Namespace")["metadata"]["labels"]["pod-security.kubernetes.io/enforce"] == "restricted"


@pytest.mark.parametrize("name", PODS)
def test_a_pod_may_do_nothing_that_it_need_not(name: str) -> None:
    pod = pods()[name]
    inside = pod.spec["securityContext"]
    assert inside["runAsNonRoot"] is True
    assert inside["runAsUser"] > 0
    assert inside["seccompProfile"] == {"type": "RuntimeDefault"}
    assert not {"hostNetwork", "hostPID", "hostIPC"} & set(pod.spec)
    if name != "head":  # whose autoscaler asks the cluster's API
        assert pod.spec["automountServiceAccountToken"] is False
    volumes = {volume["name"] for volume in pod.spec.get("volumes", ())} | {"data"}
    for container in pod.containers():
        allowed = container["securityContext"]
        assert allowed["allowPrivilegeEscalation"] is False
        assert allowed["readOnlyRootFilesystem"] is True
        assert allowed["capabilities"] == {"drop": ["ALL"]}
        assert set(allowed) == {"allowPrivilegeEscalation", "readOnlyRootFilesystem", "capabilities"}
        assert {mount["name"] for mount in container["volumeMounts"]} <= volumes
        assert "/tmp" in {mount["mountPath"] for mount in container["volumeMounts"]}
        assert "memory" in container["resources"]["limits"]


def test_images() -> None:
    """One for the server and Ray's nodes, as the Dockerfile makes it; the compose file's for the database."""
    images = {(name, container["image"]) for name, pod in pods().items() for container in pod.containers()}
    database = yaml.safe_load((ROOT / "deploy/compose.yaml").read_text())["services"]["database"]["image"]
    assert images == {("database", database), *((name, IMAGE) for name in PODS[1:])}
    assert IMAGE in RUNBOOK
    user = re.search(r"^USER (\d+):(\d+)$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    assert user is not None
    for name in PODS[1:]:
        inside = pods()[name].spec["securityContext"]
        assert [inside["runAsUser"], inside["runAsGroup"]] == [int(user[1]), int(user[2])]


def test_names_of_the_environment_are_known() -> None:
    sources = "".join(path.read_text() for path in (ROOT / "service").rglob("*.py"))
    sources += (ROOT / "renderer/primray/core/native.py").read_text()
    database = yaml.safe_load((ROOT / "deploy/compose.yaml").read_text())["services"]["database"]["environment"]
    known = {*database, "PGDATA"}
    for pod in pods().values():
        for container in pod.containers():
            texts = " ".join(each.get("value", "") for each in container["env"])
            for each in container["env"]:
                name = each["name"]
                assert name in known or f"$({name})" in texts or re.search(rf"\b{name}\b", sources), name


def test_secrets_are_those_of_the_runbook() -> None:
    made = set(re.findall(r"create secret generic (\S+)\s+--from-literal=(\w+)=", RUNBOOK))
    used = {
        (each["valueFrom"]["secretKeyRef"]["name"], each["valueFrom"]["secretKeyRef"]["key"])
        for pod in pods().values()
        for container in pod.containers()
        for each in container["env"]
        if "valueFrom" in each
    }
    assert used == made
    assert len(used) == 2


@pytest.mark.parametrize("name", PODS[1:])
def test_every_process_of_ray_has_the_token(name: str) -> None:
    for container in pods()[name].containers():
        environment = {each["name"]: each for each in container["env"]}
        assert environment["RAY_AUTH_MODE"]["value"] == "token"
        assert environment["RAY_AUTH_TOKEN"]["valueFrom"]["secretKeyRef"]["name"] == "primray-ray"


def test_flags_are_there() -> None:
    server = pods()["server"]
    check_serve_flags(server.spec["containers"][0]["args"][1:])
    node = server.spec["initContainers"][0]
    assert [*node["command"], node["args"][0]] == ["ray", "start"]
    check_ray_flags(node["args"][1:])
    spec = one("RayCluster")["spec"]
    for group in (spec["headGroupSpec"], *spec["workerGroupSpecs"]):
        check_ray_flags(
            [f"--{name}" + ("" if value == "true" else f"={value}") for name, value in group["rayStartParams"].items()]
        )


def test_probes_ask_for_what_is_there() -> None:
    paths = set(json.loads((ROOT / "schemas/openapi.json").read_text())["paths"])
    for name, pod in pods().items():
        listening = {6379} if name == "head" else set()
        for container in pod.containers():
            flags = flags_of([word for word in container.get("args", ()) if word.startswith("--")])
            listening |= {int(value) for flag, value in flags.items() if flag.endswith("-port") and value}
            listening |= {each["containerPort"] for each in container.get("ports", ())}
        if name in ("head", "render"):
            listening |= {int(value) for flag, value in ray_flags(name).items() if flag.endswith("-port")}
        for container in pod.containers():
            names = {each["name"] for each in container.get("ports", ())}
            for probe in (container.get(f"{kind}Probe", {}) for kind in ("startup", "readiness", "liveness")):
                if "httpGet" in probe:
                    assert probe["httpGet"]["path"] in paths
                    assert probe["httpGet"]["port"] in names
                elif "tcpSocket" in probe:
                    assert probe["tcpSocket"]["port"] in listening
                else:
                    assert probe.get("exec", {}).get("command", ["pg_isready"])[0] == "pg_isready"


def ray_flags(name: str) -> dict[str, str]:
    spec = one("RayCluster")["spec"]
    groups = {"head": spec["headGroupSpec"], **{group["groupName"]: group for group in spec["workerGroupSpecs"]}}
    return {**groups[name]["rayStartParams"]}


def test_services_lead_to_pods() -> None:
    for service in of_kind("Service"):
        wanted = service["spec"]["selector"].items()
        (pod,) = [pod for pod in pods().values() if wanted <= pod.labels.items()]
        names = {port["name"] for container in pod.containers() for port in container.get("ports", ())}
        assert {port["targetPort"] for port in service["spec"]["ports"]} <= names
    for workload in (*of_kind("Deployment"), *of_kind("StatefulSet")):
        assert workload["spec"]["selector"]["matchLabels"].items() <= workload["spec"]["template"]["metadata"]["labels"].items()


def test_the_server_and_the_cluster_agree() -> None:
    cluster, server = one("RayCluster"), flags_of(pods()["server"].spec["containers"][0]["args"][1:])
    node = flags_of(pods()["server"].spec["initContainers"][0]["args"][1:])
    (group,) = cluster["spec"]["workerGroupSpecs"]
    (container,) = group["template"]["spec"]["containers"]
    head = f"{cluster['metadata']['name']}-head-svc.{NAMESPACE}.svc.cluster.local:6379"  # as KubeRay names its service
    assert server["--ray-address"] == node["--address"] == head
    assert server["--slots"] == str(group["maxReplicas"])
    assert server["--ray-cores"] == container["resources"]["limits"]["cpu"]
    assert dict([server["--ray-label"].split("=")]).items() <= group["labels"].items()
    memory, store = (int(group["rayStartParams"][name]) for name in ("memory", "object-store-memory"))
    assert server["--limit"] == f"memory_bytes={memory // 2**30}G"
    assert memory + store + 2**30 <= bytes_of(container["resources"]["limits"]["memory"])
    assert cluster["spec"]["rayVersion"] == re.search(r"^ray==(\S+)$", (ROOT / "requirements-dev.lock").read_text(), re.M)[1]  # type: ignore[index]
    database = {each["name"]: each.get("value") for each in pods()["server"].spec["containers"][0]["env"]}["PRIMRAY_DATABASE"]
    assert database == f"postgresql+psycopg://primray:$(PRIMRAY_DB_PASSWORD)@database.{NAMESPACE}.svc.cluster.local/primray"


def bytes_of(text: str) -> int:
    number, unit = text[:-2], text[-2:]
    return int(number) * {"Mi": 2**20, "Gi": 2**30}[unit]


def test_object_stores_fit_their_shared_memory() -> None:
    stores = {"server": pods()["server"].spec["initContainers"][0]["args"], "render": None}
    for name, words in stores.items():
        flags = flags_of(words[1:]) if words else {f"--{key}": value for key, value in ray_flags(name).items()}
        (shared,) = [volume for volume in pods()[name].spec["volumes"] if volume["name"] == "shared-memory"]
        assert int(flags["--object-store-memory"]) < bytes_of(shared["emptyDir"]["sizeLimit"])


def test_ray_processes_of_the_servers_pod_meet() -> None:
    spec = pods()["server"].spec
    assert spec["shareProcessNamespace"] is True
    assert spec["initContainers"][0]["restartPolicy"] == "Always"
    for path in ("/tmp/ray", "/dev/shm"):
        names = {m["name"] for c in pods()["server"].containers() for m in c["volumeMounts"] if m["mountPath"] == path}
        assert len(names) == 1
        assert all(path in {m["mountPath"] for m in c["volumeMounts"]} for c in pods()["server"].containers())


def test_nodes_come_and_go() -> None:
    spec = one("RayCluster")["spec"]
    (group,) = spec["workerGroupSpecs"]
    assert spec["enableInTreeAutoscaling"] is True
    assert spec["autoscalerOptions"]["version"] == "v2"  # the first does not know labels of nodes
    assert group["minReplicas"] == group["replicas"] == 0 < group["maxReplicas"]
    assert spec["headGroupSpec"]["rayStartParams"]["num-cpus"] == "0"
