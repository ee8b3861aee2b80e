"""Field bus of a run on the wall clock, by python-can."""

from __future__ import annotations

import functools
import logging
import socket
from collections.abc import Iterator
from contextlib import suppress

import can
import msgspec

from comms.can_udp import NODES, UdpUnicastBus
from comms.clock import Clock
from comms.errors import CommsError
from comms.messages import CanMessage

AUTO = "auto"  # multicast where this machine has it, else unicast
UNICAST = "swayless_udp"
MULTICAST = "udp_multicast"
MULTICAST_GROUP = "239.74.163.2"
DRAIN_LIMIT = 64  # frames a call
PROBE_S = 0.2
MASTER_ID = 127  # node-ID of the heartbeat of the master
EMERGENCY, HEARTBEAT = 0x080, 0x700
# what an interface raises whose device, driver, module or channel is missing
OPEN_ERRORS = (
    can.CanError,
    OSError,
    ValueError,
    TypeError,
    AttributeError,
    ImportError,
    NotImplementedError,
)
logging.getLogger("can").addHandler(logging.NullHandler())  # what it logs, its errors say too


class CanSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Interface and channel of python-can."""

    interface: str = AUTO
    channel: str = ""
    bitrate: int = 1_000_000
    port: int = 0  # of multicast; first one of unicast


class CanUnavailable(CommsError):
    """The bus cannot be opened."""


def open_bus(settings: CanSettings) -> can.BusABC:
    """Open the bus; raises CanUnavailable naming interface, channel and what is missing."""
    try:
        return _open(settings)
    except OPEN_ERRORS as error:
        raise CanUnavailable(
            f"[can] interface = {settings.interface!r}, channel = {settings.channel!r}: {error}; "
            "look for the device and its driver, or take interface = 'auto' for a simulated bus"
        ) from error


def _open(s: CanSettings) -> can.BusABC:
    if s.interface == MULTICAST:
        group = s.channel or MULTICAST_GROUP
        # hop limit 0: nothing leaves this machine
        return can.Bus(interface=MULTICAST, channel=group, port=s.port, hop_limit=0, fd=False)
    if s.interface == UNICAST:
        channel = s.channel or f"127.0.0.1:{s.port}"
        return UdpUnicastBus(channel)
    return can.Bus(interface=s.interface, channel=s.channel or None, bitrate=s.bitrate)


def chosen(settings: CanSettings) -> CanSettings:
    """Choose interface and port where the settings leave them open."""
    port = settings.port or _free_block()
    if settings.interface != AUTO:
        return msgspec.structs.replace(settings, port=port)
    interface = MULTICAST if has_multicast(port) else UNICAST
    return msgspec.structs.replace(settings, interface=interface, channel="", port=port)


def has_multicast(port: int) -> bool:
    """Tell if a frame by multicast arrives at another bus object of this machine."""
    settings = CanSettings(interface=MULTICAST, port=port)
    try:
        with _open(settings) as sender, _open(settings) as receiver:
            sender.send(can.Message(arbitration_id=0x7FF, is_extended_id=False))
            return receiver.recv(PROBE_S) is not None
    except (can.CanError, OSError, ValueError, ImportError):
        return False


def _free_block() -> int:
    """Find the first of eight free UDP ports in a row."""
    while True:
        with suppress(OSError, OverflowError), socket.socket(type=socket.SOCK_DGRAM) as first:
            first.bind(("127.0.0.1", 0))
            port = int(first.getsockname()[1])
            for other in range(port + 1, port + NODES):
                with socket.socket(type=socket.SOCK_DGRAM) as probe:
                    probe.bind(("127.0.0.1", other))
            return port


def is_of_node(can_id: int) -> bool:
    """Tell if a node, not the master, sends the identifier (CiA 301, connection set)."""
    function, node = can_id & 0x780, can_id & 0x7F
    if function == EMERGENCY:  # node 0: the SYNC of the master
        return node != 0
    if function == HEARTBEAT:
        return node != MASTER_ID
    return function in (0x180, 0x280, 0x380, 0x480, 0x580)  # TPDOs, answers of an SDO server


class CanEnd:
    """Both directions of a process on the bus."""

    def __init__(self, settings: CanSettings) -> None:
        """Raises CanUnavailable."""
        self._bus = open_bus(settings)
        self._received = 0
        self._more = False  # the last drain ended at its bound
        self.foreign = 0  # error frames, frames of CAN FD
        self.kernel_drops = 0

    def fileno(self) -> int:
        """Return the descriptor, for select."""
        return int(self._bus.fileno())

    def has_pending(self) -> bool:
        """Tell if frames wait that the last drain left."""
        return self._more

    def send(self, frame: CanMessage) -> bool:
        """Send a frame; return False if the interface does not take it."""
        message = can.Message(
            arbitration_id=frame.can_id,
            is_extended_id=frame.is_extended,
            is_remote_frame=frame.is_remote,
            dlc=frame.length,
            data=frame.data,
            check=False,
        )
        try:
            self._bus.send(message)
        except can.CanError:
            return False
        return True

    def drain(self, clock: Clock, of_nodes: bool) -> Iterator[CanMessage]:
        """Yield the frames received so far, at most DRAIN_LIMIT, stamped with their arrival.

        of_nodes: those that nodes send, else those that a master sends. The others are left out:
        an interface may return what this process sent itself.
        """
        self._more = False
        for _ in range(DRAIN_LIMIT):
            message = self._bus.recv(0)
            if message is None:
                return
            if message.is_error_frame or message.is_fd:
                self.foreign += 1
                continue
            if is_of_node(message.arbitration_id) != of_nodes:
                continue
            self._received += 1
            yield CanMessage(
                seq=self._received - 1,
                t_ns=clock.now_ns(),
                can_id=message.arbitration_id,
                is_extended=message.is_extended_id,
                is_remote=message.is_remote_frame,
                length=message.dlc,
                data=bytes(message.data),
            )
        self._more = True

    def close(self) -> None:
        """Leave the bus."""
        self._bus.shutdown()


@functools.cache
def shared(settings: CanSettings) -> CanEnd:
    """Return the end of this process on a bus: one for both directions."""
    return CanEnd(settings)
