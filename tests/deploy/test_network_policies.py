"""Who reaches whom in deploy/kubernetes: the server alone speaks to Ray and to PostgreSQL."""

from __future__ import annotations

import pytest

from .manifests import NAMESPACE, of_kind, pods
from .network import Place, reaches, selected

POLICIES = of_kind("NetworkPolicy")
HERE = {name: Place(NAMESPACE, pod.labels) for name, pod in pods().items()}
OTHERS = {
    "stranger": Place(NAMESPACE, {"app": "stranger"}),
    "elsewhere": Place("default", {"app.kubernetes.io/part-of": "primray", "app.kubernetes.io/component": "server"}),
    "ingress": Place("ingress", {"app": "nginx"}, {"primray/clients": "yes"}),
    "names": Place("kube-system", {"k8s-app": "kube-dns"}),
    "internet": Place(address="93.184.216.34"),
}
PLACES = HERE | OTHERS
RAY_PORTS = {"gcs": 6379, "raylet": 6380, "objects": 6381, "first worker": 10002, "last worker": 19999}


def allowed(source: str, target: str, port: int, protocol: str = "TCP") -> bool:
    return reaches(POLICIES, PLACES[source], PLACES[target], port, protocol)


def test_every_pod_is_held_and_every_policy_holds_one() -> None:
    for direction in ("Ingress", "Egress"):
        held = [policy for policy in POLICIES if direction in policy["spec"]["policyTypes"]]
        assert all(any(selected(policy, place) for policy in held) for place in [*HERE.values(), PLACES["stranger"]])
    for policy in POLICIES:
        assert any(selected(policy, place) for place in HERE.values()), policy["metadata"]["name"]
        assert policy["spec"]["podSelector"] or not {"ingress", "egress"} & set(policy["spec"])


@pytest.mark.parametrize("source", PLACES)
def test_the_database_hears_the_server(source: str) -> None:
    assert allowed(source, "database", 5432) == (source == "server")
    assert not allowed(source, "database", 22)


@pytest.mark.parametrize("port", RAY_PORTS.values(), ids=RAY_PORTS)
@pytest.mark.parametrize("source", PLACES)
def test_rays_nodes_hear_each_other_and_the_server(source: str, port: int) -> None:
    for target in ("head", "render"):
        assert allowed(source, target, port) == (source in ("head", "render", "server"))


@pytest.mark.parametrize("port", RAY_PORTS.values(), ids=RAY_PORTS)
@pytest.mark.parametrize("source", PLACES)
def test_the_servers_ray_node_hears_rays_nodes(source: str, port: int) -> None:
    assert allowed(source, "server", port) == (source in ("head", "render"))


@pytest.mark.parametrize("source", PLACES)
def test_the_server_answers_clients_alone(source: str) -> None:
    assert allowed(source, "server", 8700) == (source == "ingress")


@pytest.mark.parametrize("port", [8080, 8265, 10001, 52365])
def test_nobody_reaches_rays_dashboard_or_its_clients_port(port: int) -> None:
    assert not any(allowed(source, target, port) for source in PLACES for target in ("head", "render", "server"))


@pytest.mark.parametrize("source", HERE)
def test_who_calls_out(source: str) -> None:
    assert allowed(source, "internet", 443) == (source == "head")  # its autoscaler: the cluster's API
    assert not allowed(source, "internet", 80)
    assert allowed(source, "names", 53, "UDP")
    assert not allowed(source, "stranger", 80)
