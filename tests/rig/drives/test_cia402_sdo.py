"""SDO server against the protocol of CiA 301."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.drives.cia402.errors import Cia402Error
from rig.drives.cia402.object_dictionary import ObjectDictionary
from rig.drives.cia402.sdo import SdoServer
from tests.rig.drives.cia402_bench import MS, NodeBench, SdoRefused

STRING = 0x6404  # the longest writable object, up to 255 bytes


def abort_code(answer):
    assert answer[0] == 0x80
    return int.from_bytes(answer[4:], "little")


@given(data=st.binary(max_size=200))
def test_a_string_survives_segmented_download_and_upload(data):
    bench = NodeBench()
    bench.download(STRING, 0, data, segmented=True)
    assert bench.upload(STRING) == data


@given(data=st.binary(min_size=1, max_size=4))
def test_a_short_string_survives_expedited_download_and_upload(data):
    bench = NodeBench()
    bench.download(STRING, 0, data)
    assert bench.upload(STRING) == data


@given(value=st.integers(-(2**31), 2**31 - 1))
def test_an_integer_may_be_downloaded_in_segments(value):
    bench = NodeBench()
    bench.download(0x607A, 0, value.to_bytes(4, "little", signed=True), segmented=True)
    assert bench.read(0x607A, signed=True) == value


@given(frames=st.lists(st.binary(max_size=8), max_size=20))
def test_no_sequence_of_requests_stops_the_server(frames):
    bench = NodeBench()
    for data in frames:
        answers = [f for f in bench.send(0x605, data) if f.can_id == 0x585]
        assert len(answers) <= (len(data) == 8)
    bench.send(0x605, b"\x80" + bytes(7))
    assert bench.read(0x1000) == 0x00020192


def test_the_device_name_is_uploaded_in_segments():
    assert NodeBench().upload(0x1008) == b"Swayless servo drive"


def test_an_expedited_download_without_size_takes_the_size_of_the_object():
    bench = NodeBench()
    assert bench.request(b"\x22\x17\x10\0\x64\0\xff\xff")[0] == 0x60
    assert bench.read(0x1017) == 100


def test_a_segmented_download_without_size_is_checked_at_its_end():
    bench = NodeBench()
    assert bench.request(b"\x20\x17\x10\0" + bytes(4))[0] == 0x60
    assert abort_code(bench.request(b"\x07\1\2\3\4" + bytes(3))) == 0x06070012
    assert bench.request(b"\x20\x17\x10\0" + bytes(4))[0] == 0x60
    assert bench.request(b"\x0b\x64\0" + bytes(5))[0] == 0x20
    assert bench.read(0x1017) == 100


def test_a_toggle_bit_that_does_not_alternate_aborts_an_upload():
    bench = NodeBench()
    bench.request(b"\x40\x08\x10\0" + bytes(4))
    assert bench.request(b"\x60" + bytes(7))[0] == 0x00
    assert abort_code(bench.request(b"\x60" + bytes(7))) == 0x05030000
    assert abort_code(bench.request(b"\x70" + bytes(7))) == 0x05040001


def test_a_toggle_bit_that_does_not_alternate_aborts_a_download_without_a_write():
    bench = NodeBench()
    bench.request(b"\x21\x04\x64\0\x08\0\0\0")
    assert abort_code(bench.request(b"\x10abcdefg")) == 0x05030000
    assert bench.upload(STRING) == b""


@pytest.mark.parametrize("command", [0xA0, 0xC0, 0xE0])
def test_block_transfer_is_an_unknown_command(command):
    request = bytes([command, 0x08, 0x10, 0, 0, 0, 0, 0])
    answer = NodeBench().request(request)
    assert answer[1:4] == request[1:4]
    assert abort_code(answer) == 0x05040001


@pytest.mark.parametrize("command", [0x60, 0x00])
def test_a_segment_without_transfer_is_an_unknown_command(command):
    assert abort_code(NodeBench().request(bytes([command]) + bytes(7))) == 0x05040001


def test_a_segment_of_the_other_direction_ends_the_transfer():
    bench = NodeBench()
    bench.request(b"\x40\x08\x10\0" + bytes(4))
    assert abort_code(bench.request(bytes(8))) == 0x05040001
    assert abort_code(bench.request(b"\x60" + bytes(7))) == 0x05040001


def test_a_download_of_another_length_than_announced_is_refused():
    bench = NodeBench()
    bench.request(b"\x21\x04\x64\0\x05\0\0\0")
    assert abort_code(bench.request(b"\x07abcd\0\0\0")) == 0x06070010
    assert bench.upload(STRING) == b""


@pytest.mark.parametrize(("size", "code"), [(5, 0x06070012), (3, 0x06070013)])
def test_an_announced_length_that_does_not_fit_is_refused_at_once(size, code):
    request = b"\x21\x7a\x60\0" + size.to_bytes(4, "little")
    assert abort_code(NodeBench().request(request)) == code


def test_a_string_beyond_255_bytes_is_refused_also_if_its_length_is_not_announced():
    bench = NodeBench()
    with pytest.raises(SdoRefused) as refused:
        bench.download(STRING, 0, bytes(256))
    assert refused.value.code == 0x06070012
    bench.request(b"\x20\x04\x64\0" + bytes(4))
    answers = [bench.request(bytes([n % 2 << 4]) + bytes(7)) for n in range(37)]
    assert abort_code(answers[-1]) == 0x06070012


def test_an_abort_of_the_client_ends_the_transfer_without_answer():
    bench = NodeBench()
    bench.request(b"\x40\x08\x10\0" + bytes(4))
    assert bench.send(0x605, b"\x80\x08\x10\0" + bytes(4)) == []
    assert abort_code(bench.request(b"\x60" + bytes(7))) == 0x05040001


def test_a_new_request_replaces_a_transfer_in_progress():
    bench = NodeBench()
    bench.request(b"\x40\x08\x10\0" + bytes(4))
    assert bench.read(0x1000) == 0x00020192
    assert abort_code(bench.request(b"\x60" + bytes(7))) == 0x05040001


def test_a_transfer_without_next_request_times_out_once():
    bench = NodeBench(sdo_timeout_ns=50 * MS)
    bench.request(b"\x40\x08\x10\0" + bytes(4))
    assert bench.node.on_time(49 * MS) == []
    (frame,) = bench.node.on_time(50 * MS)
    assert frame.can_id == 0x585
    assert frame.data[1:4] == b"\x08\x10\0"
    assert abort_code(frame.data) == 0x05040000
    assert bench.node.on_time(51 * MS) == []


def test_each_segment_starts_the_time_out_anew():
    bench = NodeBench(sdo_timeout_ns=50 * MS)
    bench.request(b"\x40\x08\x10\0" + bytes(4))
    bench.t_ns = 40 * MS
    bench.request(b"\x60" + bytes(7))
    assert bench.node.on_time(80 * MS) == []
    assert len(bench.node.on_time(90 * MS)) == 1


def test_a_time_out_must_be_positive():
    with pytest.raises(Cia402Error, match="timeout_ns = 0; must be > 0"):
        SdoServer(ObjectDictionary(1), 0)


@pytest.mark.parametrize("size", [0, 7])
def test_a_request_that_is_not_8_bytes_long_is_ignored(size):
    assert NodeBench().send(0x605, bytes(size)) == []


def test_a_request_to_another_node_is_ignored():
    assert NodeBench().send(0x606, b"\x40\0\x10\0" + bytes(4)) == []
