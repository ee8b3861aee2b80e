"""CANopen node of a drive on an ideal axis, with an SDO client written from CiA 301."""

from rig.drives.cia402.frames import CanFrame
from rig.drives.cia402.node import DriveNode
from rig.drives.cia402.signals import DriveFeedback

NODE_ID = 5
MS = 1_000_000  # [ns]
SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP, DISABLE_VOLTAGE = 0x06, 0x07, 0x0F, 0x02, 0x00


class SdoRefused(Exception):
    """Abort of the server."""

    def __init__(self, code):
        super().__init__(f"0x{code:08X}")
        self.code = code


class NodeBench:
    """Node, ideal axis and master; a sample is 1 ms."""

    def __init__(self, units=None, negative_end=None, positive_end=None, **options):
        self.node = DriveNode(NODE_ID, units, **options)
        self.t_ns = 0
        self.position = 0.0
        self.velocity = 0.0
        self.torque_gain = 0.0  # acceleration of the axis for a torque of 1 permille
        self.ends = (negative_end, positive_end)
        self.drive_fault = 0
        self.is_stuck = False
        self.demand = None
        self.sent = []
        self.sent += self.node.on_time(0)

    def send(self, can_id, data=b"", is_remote=False):
        """Frames that the node answers."""
        frames = self.node.on_frame(CanFrame(can_id, bytes(data), is_remote), self.t_ns)
        self.sent += frames
        return frames

    def nmt(self, command, node_id=NODE_ID):
        return self.send(0x000, [command, node_id])

    def sync(self):
        return self.send(0x080)

    def request(self, data):
        """Data of the one SDO response."""
        (answer,) = [f.data for f in self.send(0x600 + NODE_ID, data) if f.can_id == 0x585]
        assert len(answer) == 8
        return answer

    def upload(self, index, sub=0):
        """Bytes of an object, by expedited or segmented transfer."""
        answer = self._checked(bytes([0x40]) + index.to_bytes(2, "little") + bytes([sub] + [0] * 4))
        assert answer[1:4] == index.to_bytes(2, "little") + bytes([sub])
        if answer[0] & 2:
            return answer[4 : 8 - (answer[0] >> 2 & 3)]
        size, data, toggle = int.from_bytes(answer[4:], "little"), b"", 0
        while True:
            answer = self._checked(bytes([0x60 | toggle]) + bytes(7))
            assert answer[0] & 0xF0 == toggle
            data += answer[1 : 8 - (answer[0] >> 1 & 7)]
            toggle ^= 0x10
            if answer[0] & 1:
                assert len(data) == size
                return data

    def download(self, index, sub, data, *, segmented=False):
        """Write bytes by expedited transfer if they are 1 to 4, else by segments."""
        head = index.to_bytes(2, "little") + bytes([sub])
        if 0 < len(data) <= 4 and not segmented:
            command = 0x23 | (4 - len(data)) << 2
            answer = self._checked(bytes([command]) + head + data + bytes(4 - len(data)))
            assert answer == b"\x60" + head + bytes(4)
            return
        answer = self._checked(b"\x21" + head + len(data).to_bytes(4, "little"))
        assert answer == b"\x60" + head + bytes(4)
        pieces = [data[at : at + 7] for at in range(0, len(data), 7)] or [b""]
        for number, piece in enumerate(pieces):
            toggle = number % 2 << 4
            last = number == len(pieces) - 1
            command = toggle | (7 - len(piece)) << 1 | last
            answer = self._checked(bytes([command]) + piece + bytes(7 - len(piece)))
            assert answer == bytes([0x20 | toggle]) + bytes(7)

    def _checked(self, request):
        answer = self.request(request)
        if answer[0] == 0x80:
            raise SdoRefused(int.from_bytes(answer[4:], "little"))
        return answer

    def write(self, index, value, sub=0):
        """Write an integer with the length of its entry."""
        entry = self.node.dictionary.entry(index, sub)
        self.download(index, sub, value.to_bytes(entry.length, "little", signed=value < 0))

    def read(self, index, sub=0, signed=False):
        return int.from_bytes(self.upload(index, sub), "little", signed=signed)

    @property
    def status(self):
        return self.read(0x6041)

    def command(self, *words):
        for word in words:
            self.write(0x6040, word)

    def enable(self, mode=0):
        """Bring the drive into OPERATION ENABLED in a mode."""
        self.run(1)
        self.write(0x6060, mode)
        self.command(SHUTDOWN, SWITCH_ON, ENABLE)
        assert self.status & 0x6F == 0x27
        return self

    def feedback(self):
        low, high = self.ends
        return DriveFeedback(
            position=self.position,
            velocity=self.velocity,
            negative_switch=low is not None and self.position <= low,
            positive_switch=high is not None and self.position >= high,
            drive_fault=self.drive_fault,
        )

    def run(self, samples, dt_ns=MS):
        """Demands of some samples; the axis then follows each for one sample."""
        demands = []
        for _ in range(samples):
            self.demand = self.node.step(self.t_ns, self.feedback())
            demands.append(self.demand)
            self.sent += self.node.on_time(self.t_ns)
            self._move(dt_ns * 1e-9)
            self.t_ns += dt_ns
        return demands

    def _move(self, dt_s):
        if self.is_stuck:
            self.velocity = 0.0
        elif self.demand.kind in ("position", "brake"):
            self.velocity = self.demand.velocity
            self.position = self.demand.position
        elif self.demand.kind == "velocity":
            self.velocity = self.demand.velocity
            self.position += self.velocity * dt_s
        elif self.demand.kind == "torque":
            self.velocity += self.demand.torque * self.torque_gain * dt_s
            self.position += self.velocity * dt_s
        else:
            self.velocity = 0.0

    def emergencies(self):
        """(code, register) of the emergency messages so far."""
        data = [f.data for f in self.sent if f.can_id == 0x080 + NODE_ID]
        return [(int.from_bytes(d[:2], "little"), d[2]) for d in data]
