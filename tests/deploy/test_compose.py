"""The compose files: as Docker Compose's own library reads them, and what they say of the image, of flags and of each other."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
import tomllib
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

from .flags import check_ray_flags, check_serve_flags, flags_of
from .go_modules import COMPOSE, go
from .manifests import ROOT

FILES = ["compose.yaml", "compose.ray.yaml"]
SECRETS = {"PRIMRAY_DB_PASSWORD": "apassword", "PRIMRAY_RAY_TOKEN": "a" * 64}
GIVEN = {**SECRETS, "PRIMRAY_HOST": "render.example"}


def loaded(file: Path) -> subprocess.CompletedProcess[str]:
    done = go("run", COMPOSE, str(file), folder=ROOT / "deploy")
    if "dial tcp" in done.stderr and not os.environ.get("CI"):
        pytest.skip("skipped: no compose-go")
    return done


@cache
def read(name: str) -> str:
    """Secrets are filled in here: the library's program does not look into its environment when it is asked for the model."""
    text = re.sub(r"\$\{(\w+)(:[?-][^}]*)?\}", lambda found: GIVEN[found[1]], (ROOT / "deploy" / name).read_text())
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, name)
        file.write_text(text)
        done = loaded(file)
    assert done.returncode == 0, done.stderr
    return done.stdout


def project(name: str) -> Any:
    """Everything filled in, as Docker Compose would have it."""
    return yaml.safe_load(read(name))


@pytest.mark.parametrize("name", FILES)
def test_it_is_valid(name: str) -> None:
    services = project(name)["services"]
    assert {"database", "server"} <= set(services)
    for service in services.values():
        assert service["restart"] == "unless-stopped"
        if "build" in service:
            assert (ROOT / "Dockerfile").samefile(os.path.join(service["build"]["context"], service["build"]["dockerfile"]))
            assert service["read_only"] is True
            assert service["cap_drop"] == ["ALL"]
            assert service["security_opt"] == ["no-new-privileges:true"]
            assert "user" not in service  # the image's own, which is not root


@pytest.mark.parametrize(("name", "secrets"), [(FILES[0], ["PRIMRAY_DB_PASSWORD"]), (FILES[1], [*SECRETS])])
def test_nothing_starts_without_its_secrets(name: str, secrets: Sequence[str]) -> None:
    done = loaded(ROOT / "deploy" / name)
    assert done.returncode != 0
    assert all(f"required variable {secret} is missing a value" in done.stderr for secret in secrets)


def test_what_is_wrong_is_found(tmp_path: Path) -> None:
    file = tmp_path / "compose.yaml"
    for wrong in ("imge: a", "read_only: {}", "ports: [nothing:here]", "restart: [always]"):
        file.write_text(f"services:\n  server:\n    image: a\n    {wrong}\n")
        assert loaded(file).returncode != 0, wrong


@pytest.mark.parametrize("name", FILES)
def test_the_servers_flags_are_ours(name: str) -> None:
    server = project(name)["services"]["server"]
    assert server["command"][0] == "serve"
    check_serve_flags(server["command"][1:])
    assert set(server["environment"]) <= {"PRIMRAY_DATABASE", "FORWARDED_ALLOW_IPS", "RAY_AUTH_MODE", "RAY_AUTH_TOKEN"}
    assert server["environment"]["PRIMRAY_DATABASE"] == "postgresql+psycopg://primray:apassword@database/primray"


@pytest.mark.parametrize("name", FILES)
def test_names_lead_to_what_is_there(name: str) -> None:
    """Which Docker Compose finds out only when it starts them."""
    found = project(name)
    for service in found["services"].values():
        assert set(service.get("depends_on", ())) <= set(found["services"])
        assert set(service.get("networks", ())) <= set(found["networks"])
        shared = {service[key].partition(":") for key in ("network_mode", "pid", "ipc") if ":" in service.get(key, "")}
        assert {(kind, name in found["services"]) for kind, _, name in shared} <= {("service", True)}
        volumes = {each["source"] for each in service.get("volumes", ()) if each["type"] == "volume" and "source" in each}
        assert volumes <= set(found["volumes"])


def test_both_have_the_same_database() -> None:
    first, second = (project(name)["services"]["database"] for name in FILES)
    assert first["image"] == second["image"]
    assert first["environment"] == second["environment"]


def test_two_nodes_meet_a_head_that_shares_the_servers_machine() -> None:
    services = project(FILES[1])["services"]
    assert services["node"]["deploy"]["replicas"] == 2
    for name in ("head", "node"):
        assert services[name]["entrypoint"][:2] == ["ray", "start"]
        check_ray_flags([*services[name]["entrypoint"][2:], *services[name]["command"]])
    for shared in ("network_mode", "pid", "ipc"):
        assert services["head"][shared] == services["server"][shared] == "service:machine"
    sessions = [mount for name in ("head", "server") for mount in services[name]["volumes"] if mount["target"] == "/tmp/ray"]
    assert {mount["source"] for mount in sessions} == {"session"}
    assert len(sessions) == 2
    for name in ("head", "server", "node"):
        assert services[name]["environment"]["RAY_AUTH_MODE"] == "token"
        assert services[name]["environment"]["RAY_AUTH_TOKEN"] == SECRETS["PRIMRAY_RAY_TOKEN"]
    assert "ray" in services["node"]["build"]["args"]["EXTRAS"].split(",")


def test_its_addresses_and_sizes_agree() -> None:
    found = project(FILES[1])
    services = found["services"]
    address = services["machine"]["networks"]["ray"]["ipv4_address"]
    head, node = (flags_of(services[name]["command"]) for name in ("head", "node"))
    server = flags_of(services["server"]["command"][1:])
    assert head["--node-ip-address"] == address
    assert {node["--address"], server["--ray-address"]} == {f"{address}:{head['--port']}"}
    assert server["--ray-cores"] == node["--num-cpus"]
    assert server["--slots"] == str(services["node"]["deploy"]["replicas"])
    assert server["--limit"] == f"memory_bytes={int(node['--memory']) // 2**30}G"


@pytest.mark.parametrize(("name", "server"), [(FILES[0], "server"), (FILES[1], "machine")])
def test_only_the_proxy_is_published_and_only_with_tls(name: str, server: str) -> None:
    found = project(name)
    services, proxy = found["services"], found["services"]["proxy"]
    assert {name for name, service in services.items() if "ports" in service} == {"proxy"}
    assert {(str(port["published"]), port["target"]) for port in proxy["ports"]} == {("443", 443)}
    assert proxy["environment"] == {"PRIMRAY_HOST": GIVEN["PRIMRAY_HOST"], "PRIMRAY_SERVER": f"{server}:8700"}
    assert set(proxy["networks"]) & set(services[server]["networks"]) == {"outside"}
    assert flags_of(services["server"]["command"][1:])["--allow-host"] == GIVEN["PRIMRAY_HOST"]
    # The server believes the proxy's X-Forwarded-Proto, and has no other client.
    assert services["server"]["environment"]["FORWARDED_ALLOW_IPS"] == "*"
    assert "outside" not in services["database"]["networks"]
    assert all(network.get("internal") for each, network in found["networks"].items() if each != "outside")
    (configuration,) = [mount for mount in proxy["volumes"] if mount["target"] == "/etc/caddy/Caddyfile"]
    assert configuration["read_only"] is True
    assert Path(configuration["source"]).name == "Caddyfile"


def test_nodes_and_database_have_no_way_out() -> None:
    found = project(FILES[1])
    assert set(found["services"]["node"]["networks"]) == {"ray"}
    assert set(found["services"]["database"]["networks"]) == {"database"}


def test_the_image_has_the_denoiser_and_the_object_stores_client() -> None:
    """Of extras that there are; compose's image with Ray has them too."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    (default,) = re.findall(r"^ARG EXTRAS=(\S+)$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    for names in (default, project(FILES[1])["services"]["node"]["build"]["args"]["EXTRAS"]):
        chosen = set(names.split(","))
        assert chosen <= set(extras)
        packages = " ".join(requirement for name in chosen for requirement in extras[name])
        for package in ("pyoidn", "s3fs", "psycopg", "uvicorn"):
            assert package in packages, package
