"""What webhooks may call: every special-purpose range refused, by number, by name, in any spelling."""

from __future__ import annotations

import ipaddress
import socket
import threading
from collections.abc import Sequence
from pathlib import Path

import pytest

from primray_service.config import ServeConfig
from primray_service.problems import Problem
from primray_service.webhooks import addresses
from primray_service.webhooks.addresses import check_address, is_public, may_be_called

CLOSED = ServeConfig(Path("data"))
OPENED = ServeConfig(Path("data"), webhook_http=True, webhook_networks=("10.1.0.0/16", "::1/128"))


def public(host: str, port: int) -> Sequence[str]:
    return ["93.184.215.14", "2606:2800:21f:cb07:6820:80da:af6b:8b2c"]


def refusal(url: str, config: ServeConfig = CLOSED, resolve: addresses.Resolve = public) -> str:
    with pytest.raises(Problem) as caught:
        check_address(url, config, resolve)
    assert caught.value.slug == "webhook-address"
    assert caught.value.status == 422
    return caught.value.detail


@pytest.mark.parametrize(
    "address",
    [
        "0.0.0.0",
        "0.1.2.3",
        "10.0.0.1",
        "100.64.0.1",
        "100.100.100.200",
        "100.127.255.255",
        "127.0.0.1",
        "127.255.255.254",
        "168.63.129.16",
        "169.254.169.254",
        "172.16.0.1",
        "172.31.255.255",
        "192.0.0.8",
        "192.0.2.1",
        "192.88.99.2",
        "192.168.1.1",
        "198.18.0.1",
        "198.19.255.255",
        "198.51.100.7",
        "203.0.113.9",
        "224.0.0.1",
        "239.255.255.255",
        "240.0.0.1",
        "255.255.255.255",
        "::",
        "::1",
        "::ffff:127.0.0.1",
        "::ffff:169.254.169.254",
        "::127.0.0.1",
        "64:ff9b::7f00:1",
        "64:ff9b:1::1",
        "100::1",
        "2001::1",
        "2001:20::1",
        "2001:db8::1",
        "2002:7f00:1::1",
        "3fff::1",
        "5f00::1",
        "fc00::1",
        "fd00:ec2::254",
        "fe80::1",
        "fe80::1%eth0",
        "fec0::1",
        "ff02::1",
    ],
)
def test_special_addresses_are_refused(address: str) -> None:
    assert not may_be_called(address, ())


@pytest.mark.parametrize(
    "address",
    ["1.1.1.1", "8.8.8.8", "100.63.255.255", "100.128.0.1", "172.15.0.1", "172.32.0.1", "2606:4700::1111", "::ffff:8.8.8.8"],
)
def test_public_addresses_are_not(address: str) -> None:
    assert may_be_called(address, ())


def test_the_standard_librarys_table_refuses_nothing_that_is_called_here() -> None:
    """An independent reading of the registries: what `is_global` denies of each /16 (and of IPv6's /16s) is denied here too."""
    for number in range(0, 2**32, 2**16):
        address = ipaddress.IPv4Address(number + 0x0101)
        assert address.is_global or not is_public(address), address
    for number in range(2**16):
        address6 = ipaddress.IPv6Address((number << 112) + 0x0101)
        assert address6.is_global or not is_public(address6), address6


def test_an_opened_network_is_called_also_in_ipv6s_clothes() -> None:
    networks = OPENED.webhook_networks
    assert may_be_called("10.1.2.3", networks)
    assert may_be_called("::ffff:10.1.2.3", networks)
    assert may_be_called("::1", networks)
    assert not may_be_called("10.2.0.1", networks)


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("http://example.com/", "https://"),
        ("ftp://example.com/", "https://"),
        ("example.com/hook", "https://"),
        ("https://", "no host"),
        ("https:///path", "no host"),
        ("https://user:secret@example.com/", "user name"),
        ("https://127.0.0.1\\@example.com/", "user name"),
        ("https://example.com:0/", "port"),
        ("https://example.com:99999/", "port"),
        ("https://exam\nple.com/", "not a URL"),
        ("https://[::1/", "not a URL"),
        ("https://example.com/" + "a" * 2048, "longer than"),
    ],
)
def test_urls_that_are_none(url: str, says: str) -> None:
    detail = refusal(url)
    assert says in detail
    assert "secret" not in detail


@pytest.mark.parametrize(
    "url",
    [
        "https://127.0.0.1/hook",
        "https://0x7f.1/",  # spellings that the system's resolver takes
        "https://2130706433/",
        "https://0177.0.0.1/",
        "https://127.1:8443/",
        "https://[::1]/",
        "https://[::ffff:127.0.0.1]/",
        "https://[::ffff:a9fe:a9fe]/latest/meta-data",
        "https://169.254.169.254/latest/meta-data",
        "https://localhost/",
        "https://localhost./",
        "https://0/",
    ],
)
def test_private_addresses_are_refused_when_a_job_is_submitted(url: str) -> None:
    """By the system's own resolver; a spelling that it does not know is no host."""
    detail = refusal(url, resolve=addresses.resolve_now)
    assert "public internet" in detail or (("0177" in url or "localhost." in url) and ("no host" in detail or "URL" in detail))


def test_one_private_address_among_public_ones_is_enough() -> None:
    detail = refusal("https://example.com/", resolve=lambda host, port: ["93.184.215.14", "10.0.0.7"])
    assert "10.0.0.7" not in detail  # what names mean inside of the network is not told


def test_a_public_address_is_taken() -> None:
    check_address("https://example.com/hook?a=b#c", CLOSED, public)
    check_address("https://münchen.example/", CLOSED, public)
    check_address("http://10.1.0.1:8080/", OPENED, addresses.resolve_now)


def test_a_name_that_does_not_exist_is_refused_and_one_that_cannot_be_looked_up_now_is_not() -> None:
    def failing(number: int) -> addresses.Resolve:
        def resolve(host: str, port: int) -> Sequence[str]:
            raise socket.gaierror(number, "no")

        return resolve

    assert "no host named nothere.example" in refusal("https://nothere.example/", resolve=failing(socket.EAI_NONAME))
    check_address("https://example.com/", CLOSED, failing(socket.EAI_AGAIN))


def test_a_resolver_that_hangs_keeps_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(addresses, "LOOK_UP_S", 0.05)

    may_answer = threading.Event()

    def slow(host: str, port: int) -> Sequence[str]:
        assert may_answer.wait(60)
        return ["10.0.0.1"]

    check_address("https://example.com/", CLOSED, slow)  # without the answer, which would be refused
    may_answer.set()
