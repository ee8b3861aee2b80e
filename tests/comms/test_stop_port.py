"""Stop ports: the key of the run and an order, and nothing else, stop the robot."""

from __future__ import annotations

import select
import socket
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from comms import udp
from comms.errors import PortInUse
from comms.stop_port import HOST, KEY_BYTES, StopPort, send_stop

KEY = bytes(range(KEY_BYTES))
OTHER_KEY = KEY[:-1] + b"x"
WAIT_S = 5.0  # far beyond what the loopback needs; only a failure takes it


@pytest.fixture(scope="module")
def port() -> Iterator[StopPort]:
    """Stop port on a free port."""
    port = StopPort(0, KEY)
    yield port
    port.close()


def requests_after(port: StopPort, *datagrams: bytes) -> tuple[list[str], int]:
    """Requests that a port takes of these datagrams, and how many it ignores."""
    ignored_before, requests = port.ignored, list[str]()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for data in datagrams:
            stranger.sendto(data, (HOST, port.port))
    while len(requests) + port.ignored - ignored_before < len(datagrams):
        assert select.select([port], [], [], WAIT_S)[0], "a datagram did not arrive"
        requests += port.drain()
    return requests, port.ignored - ignored_before


@pytest.mark.parametrize("request_name", ["stop", "estop"])
def test_an_order_with_the_key_of_the_run_is_taken(port: StopPort, request_name: str) -> None:
    send_stop(port.port, KEY, request_name)
    assert select.select([port], [], [], WAIT_S)[0]
    assert port.drain() == [request_name]


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(b"", id="empty"),
        pytest.param(b"stop", id="no_key"),
        pytest.param(KEY, id="no_order"),
        pytest.param(OTHER_KEY + b"stop", id="another_key"),
        pytest.param(KEY + b"start", id="another_order"),
        pytest.param(KEY + b"stop\0", id="one_byte_more"),
        pytest.param(KEY + b"stop" * 500, id="longer_than_any_order"),
        pytest.param(KEY.hex().encode() + b"stop", id="key_in_hexadecimal"),
    ],
)
def test_anything_else_is_ignored_and_counted(port: StopPort, data: bytes) -> None:
    assert requests_after(port, data, KEY + b"stop") == (["stop"], 1)


@given(data=st.lists(st.binary(max_size=100), max_size=20))
def test_no_datagram_of_a_stranger_is_taken_for_an_order(port: StopPort, data: list[bytes]) -> None:
    assert requests_after(port, *data) == ([], len(data))


def test_a_drain_reads_a_bounded_number_of_datagrams(
    port: StopPort, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(udp, "DRAIN_LIMIT", 2)
    for _ in range(3):
        send_stop(port.port, KEY, "stop")
    assert len(port.drain()) <= 2
    select.select([port], [], [], WAIT_S)
    port.drain()


def test_a_port_in_use_is_named_with_what_to_do(port: StopPort) -> None:
    with pytest.raises(PortInUse, match=rf"UDP port {port.port} .*network\.base_port"):
        StopPort(port.port, KEY)


def test_a_short_key_is_refused() -> None:
    with pytest.raises(ValueError, match="stop key of 3 bytes; must be 16 bytes"):
        StopPort(0, b"abc")
