"""Scan of a bus for CANopen nodes: heartbeats, and answers to SDO uploads of their identity."""

from __future__ import annotations

from collections.abc import Callable

import can
import msgspec
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

from comms.channels import MS
from rig.drives.cia402.frames import HEARTBEAT, MAX_NODE_ID, MIN_NODE_ID, SDO_REQUEST, SDO_RESPONSE
from rig.run.field_bus.exchange import (
    FUNCTION_MASK,
    NODE_MASK,
    Exchange,
    ObjectClient,
    is_plain,
)
from rig.run.field_bus.names import NODE_STATES

DEVICE_TYPE, DEVICE_NAME, IDENTITY = 0x1000, 0x1008, 0x1018
UPLOAD = 0x40
ANSWER_S = 0.3  # longest wait for the answer of a node that answered before
LAST_ANSWER_NS = 50 * MS  # wait after the last request, however long the requests took
DUPLICATE_NS = 20 * MS  # after the last answer: that of a second node with the same node-ID
TOGGLE_BIT, STATE_MASK = 0x80, 0x7F
IDENTITY_NAMES = ("vendor", "product", "revision", "serial")


class FoundNode(msgspec.Struct, kw_only=True):
    """Node on a bus; None: the node did not tell."""

    node_id: int
    nmt_state: str | None = None  # of its newest heartbeat
    answers_sdo: bool = False
    is_duplicated: bool = False  # two nodes have this node-ID
    device_type: int | None = None
    vendor: int | None = None
    product: int | None = None
    revision: int | None = None
    serial: int | None = None
    name: str | None = None


class Scanner:
    """Scan of all node-IDs of a bus."""

    def __init__(self, exchange: Exchange) -> None:
        self._exchange = exchange
        self._found: dict[int, FoundNode] = {}
        exchange.on_frame = self._take

    def run(self, timeout_s: float, progress: Callable[[int], None]) -> list[FoundNode]:
        """Scan; timeout_s: longest time without any node. progress: gets each node-ID asked.

        Every node is asked for its device type, at most one a millisecond; then each that answered
        for its identity and name.
        """
        until_ns = self._exchange.now_ns() + round(timeout_s * 1e9)
        for node_id in range(MIN_NODE_ID, MAX_NODE_ID + 1):
            self._exchange.send_message(SDO_REQUEST + node_id, _upload(DEVICE_TYPE))
            progress(node_id)
        self._exchange.listen(max(until_ns, self._exchange.now_ns() + LAST_ANSWER_NS))
        for node_id in sorted(self._found):
            if self._found[node_id].answers_sdo:
                self._ask(self._found[node_id])
        self._exchange.listen(self._exchange.now_ns() + DUPLICATE_NS)
        for node in self._found.values():
            answers = self._exchange.answers[node.node_id]
            node.is_duplicated = answers > self._exchange.requests[node.node_id]
        return [self._found[node_id] for node_id in sorted(self._found)]

    def listen(self, timeout_s: float) -> list[FoundNode]:
        """Find the nodes that send a heartbeat, and send nothing."""
        self._exchange.listen(self._exchange.now_ns() + round(timeout_s * 1e9))
        return [self._found[node_id] for node_id in sorted(self._found)]

    def _take(self, message: can.Message) -> None:
        """Take a heartbeat, or the answer to the request of the device type."""
        node_id = message.arbitration_id & NODE_MASK
        if not is_plain(message) or node_id < MIN_NODE_ID:
            return
        function = message.arbitration_id & FUNCTION_MASK
        data = bytes(message.data)
        if function == HEARTBEAT and len(data) == 1:
            state = data[0] & STATE_MASK
            self._node(node_id).nmt_state = NODE_STATES.get(state, f"unknown ({state})")
        elif function == SDO_RESPONSE and len(data) == 8:
            self._node(node_id).answers_sdo = True

    def _node(self, node_id: int) -> FoundNode:
        return self._found.setdefault(node_id, FoundNode(node_id=node_id))

    def _ask(self, node: FoundNode) -> None:
        """Read identity and name; a node that falls silent is not asked any more."""
        client = ObjectClient(self._exchange, node.node_id, ANSWER_S)
        try:
            node.device_type = _integer(_read(client, DEVICE_TYPE, 0))
            for subindex, name in enumerate(IDENTITY_NAMES, start=1):
                setattr(node, name, _integer(_read(client, IDENTITY, subindex)))
            data = _read(client, DEVICE_NAME, 0)
        except SdoCommunicationError:
            return
        if data is not None:
            node.name = data.rstrip(b"\0").decode("ascii", "replace")


def _upload(index: int) -> bytes:
    return bytes([UPLOAD]) + index.to_bytes(2, "little") + bytes(5)


def _read(client: ObjectClient, index: int, subindex: int) -> bytes | None:
    """Read an object; None where the node refuses. Raises SdoCommunicationError."""
    try:
        return client.upload(index, subindex)
    except SdoAbortedError:
        return None
    except SdoError as error:
        raise SdoCommunicationError(str(error)) from error


def _integer(data: bytes | None) -> int | None:
    return None if data is None else int.from_bytes(data, "little")
