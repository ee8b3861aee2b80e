"""Real node of a drive on a bus of python-can, served by a thread of the test."""

import itertools
import threading
import time

import can

from comms.can_bus import CanSettings, open_bus
from rig.drives.cia402.frames import CanFrame
from rig.drives.cia402.node import DriveNode

NUMBERS = itertools.count()
WAIT_S = 0.005  # of one call of python-can; the thread ends within it


def new_channel():
    """Name of a virtual bus that no other test uses."""
    return f"nodes-{next(NUMBERS)}"


class ServedNodes:
    """Nodes on one bus; each takes every frame and answers at once.

    heartbeat_ms: period of the heartbeat of each node; 0 for none.
    """

    def __init__(self, channel, *node_ids, interface="virtual", heartbeat_ms=20):
        self.channel = channel
        self.nodes = [DriveNode(node_id) for node_id in node_ids]
        for serial, node in enumerate(self.nodes, start=0x100):
            node.dictionary.set(0x1017, heartbeat_ms)
            node.dictionary.set(0x1018, serial, 4)
        self.received = []  # identifier and instant [s]
        self._bus = open_bus(CanSettings(interface=interface, channel=channel))
        self._is_open = True
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *error):
        self._is_open = False
        self._thread.join()
        self._bus.shutdown()

    def _serve(self):
        while self._is_open:
            message = self._bus.recv(WAIT_S)
            for node in self.nodes:
                self._send(node.on_time(time.monotonic_ns()))
            if message is None:
                continue
            self.received.append((message.arbitration_id, time.monotonic()))
            frame = CanFrame(message.arbitration_id, bytes(message.data), message.is_remote_frame)
            for node in self.nodes:
                self._send(node.on_frame(frame, time.monotonic_ns()))

    def _send(self, frames):
        for frame in frames:
            self._bus.send(
                can.Message(arbitration_id=frame.can_id, data=frame.data, is_extended_id=False)
            )
