"""Addresses of a run: ports without overlap, and a folder of sockets for this user alone."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest
import zmq

from comms import bus_folder
from comms.channels import CHANNELS, DATA, Transport
from comms.endpoints import PORTS, STOPPABLE, TCP_PORTS, choose_ports, endpoints
from comms.udp import is_loopback

HOST = "127.0.0.1"


def test_every_port_of_a_run_is_used_once() -> None:
    ends = endpoints(HOST, choose_ports(HOST, 40_000), None)
    used = [int(address.rsplit(":", 1)[1]) for address in ends.addresses.values()]
    used += [port for pair in ends.ports.values() for port in pair]
    used += ends.stop_ports.values()
    assert sorted(used) == list(range(40_000, 40_000 + PORTS))


def test_free_ports_are_all_different() -> None:
    ports = choose_ports(HOST, 0)
    assert len(ports) == PORTS
    assert len({(port, k < TCP_PORTS) for k, port in enumerate(ports)}) == PORTS


def test_each_datagram_channel_has_a_port_at_both_ends_and_each_mover_a_stop_port() -> None:
    ends = endpoints(HOST, choose_ports(HOST, 40_000), None)
    datagrams = {name for name in DATA if CHANNELS[name].transport is Transport.UDP}
    assert ends.ports.keys() == datagrams
    assert tuple(ends.stop_ports) == STOPPABLE


def test_with_a_folder_only_datagrams_take_ports(tmp_path: Path) -> None:
    ends = endpoints(HOST, choose_ports(HOST, 40_000), tmp_path)
    assert ends.addresses["commands"] == f"ipc://{tmp_path}/commands"
    assert all(address.startswith("ipc://") for address in ends.addresses.values())


def test_the_folder_of_the_sockets_is_private_and_leaves_nothing() -> None:
    with bus_folder.opened(True) as folder:
        assert folder is not None
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        (folder / "commands").touch()  # no socket: not of a run
    assert folder.exists()
    (folder / "commands").unlink()
    bus_folder.remove(folder)
    assert not folder.exists()


def test_a_socket_is_bound_in_the_folder_and_removed_with_it() -> None:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with bus_folder.opened(True) as folder, context.socket(zmq.PULL) as socket:
        assert folder is not None
        socket.bind(bus_folder.address(folder, bus_folder.LONGEST_NAME))
        assert (folder / bus_folder.LONGEST_NAME).is_socket()
    assert not folder.exists()
    context.term()


def test_a_folder_with_a_long_path_is_made_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    deep = tmp_path / ("d" * 100)
    deep.mkdir()
    monkeypatch.setattr(bus_folder.tempfile, "gettempdir", lambda: str(deep))
    with bus_folder.opened(True) as folder:
        assert folder is not None
        assert folder.parent == Path("/tmp")
    assert list(deep.iterdir()) == []


def test_without_local_sockets_there_is_no_folder() -> None:
    with bus_folder.opened(False) as folder:
        assert folder is None


def test_a_folder_that_is_not_of_a_run_is_not_removed(tmp_path: Path) -> None:
    bus_folder.remove(tmp_path)
    bus_folder.remove(tmp_path / "rig-gone")
    assert tmp_path.exists()


@pytest.mark.parametrize(
    ("address", "folder"),
    [("ipc:///tmp/rig-a/commands", Path("/tmp/rig-a")), ("tcp://127.0.0.1:5", None)],
)
def test_the_folder_is_found_by_the_address(address: str, folder: Path | None) -> None:
    assert bus_folder.folder_of(address) == folder


@pytest.mark.parametrize("address", ["127.0.0.1", "127.0.0.9", "127.255.255.254"])
def test_loopback_addresses_are_of_this_machine(address: str) -> None:
    assert is_loopback(address)


@pytest.mark.parametrize("address", ["0.0.0.0", "10.0.0.1", "::1", "localhost", "", "128.0.0.1"])
def test_other_addresses_are_not(address: str) -> None:
    assert not is_loopback(address)
