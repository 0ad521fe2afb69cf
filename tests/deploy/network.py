"""What network policies allow, by Kubernetes' rules: a pod that any policy selects may do what one of its policies says."""

from __future__ import annotations

import ipaddress
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

Direction = Literal["Ingress", "Egress"]
Labels = Mapping[str, str]


@dataclass(frozen=True)
class Place:
    """A pod, or with an address and no labels something outside of the cluster."""

    namespace: str = ""
    labels: Labels = field(default_factory=dict)
    namespace_labels: Labels = field(default_factory=dict)
    address: str = ""


def reaches(policies: Sequence[Mapping[str, Any]], source: Place, target: Place, port: int, protocol: str = "TCP") -> bool:
    leaves = _allows(policies, "Egress", source, target, port, protocol)
    return leaves and _allows(policies, "Ingress", target, source, port, protocol)


def selected(policy: Mapping[str, Any], place: Place) -> bool:
    inside = not place.address and place.namespace == policy["metadata"]["namespace"]
    return inside and _matches(policy["spec"]["podSelector"], place.labels)


def _allows(
    policies: Sequence[Mapping[str, Any]], direction: Direction, place: Place, peer: Place, port: int, protocol: str
) -> bool:
    ours = [p for p in policies if direction in p["spec"]["policyTypes"] and selected(p, place)]
    rules = [(p, rule) for p in ours for rule in p["spec"].get(direction.lower(), ())]
    peers = "from" if direction == "Ingress" else "to"
    return not ours or any(
        any(_is_peer(p, each, peer) for each in rule[peers]) and any(_is_port(each, port, protocol) for each in rule["ports"])
        for p, rule in rules
    )


def _is_peer(policy: Mapping[str, Any], rule: Mapping[str, Any], peer: Place) -> bool:
    if "ipBlock" in rule:
        return bool(peer.address) and ipaddress.ip_address(peer.address) in ipaddress.ip_network(rule["ipBlock"]["cidr"])
    if peer.address:
        return False
    if "namespaceSelector" in rule:
        if not _matches(rule["namespaceSelector"], {"kubernetes.io/metadata.name": peer.namespace, **peer.namespace_labels}):
            return False
    elif peer.namespace != policy["metadata"]["namespace"]:
        return False
    return _matches(rule.get("podSelector", {}), peer.labels)


def _matches(selector: Mapping[str, Any], labels: Labels) -> bool:
    assert set(selector) <= {"matchLabels"}
    return all(labels.get(name) == value for name, value in selector.get("matchLabels", {}).items())


def _is_port(rule: Mapping[str, Any], port: int, protocol: str) -> bool:
    return bool(rule["protocol"] == protocol and rule["port"] <= port <= rule.get("endPort", rule["port"]))
