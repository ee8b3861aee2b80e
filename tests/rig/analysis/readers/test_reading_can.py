"""Traces of python-can with the names of a DBC file."""

import struct

import can
import numpy as np
import pytest

from rig.analysis.readers.errors import UnreadableData
from rig.analysis.readers.read import read_signal
from rig.analysis.readers.signal_record import ReadOptions
from rig.errors import ConfigError

START_S = 1_700_000_000.0
T_S = 0.01 * np.arange(120)
COUNTS = np.round(2000 * np.cos(4.6 * T_S)).astype(int)
DBC = """VERSION ""
NS_ :
BS_:
BU_: node
BO_ 385 Encoder: 6 node
 SG_ angle : 0|32@1- (0.0001,0) [-10|10] "rad" node
 SG_ flag : 32|8@1+ (1,0) [0|255] "" node
BO_ 641 Motor: 2 node
 SG_ current : 0|16@1- (0.01,0) [-100|100] "A" node
"""
WRITERS = {
    ".asc": can.ASCWriter,
    ".blf": can.BLFWriter,
    ".trc": can.TRCWriter,
    ".log": can.CanutilsLogWriter,
}


@pytest.fixture
def dbc(tmp_path):
    path = tmp_path / "names.dbc"
    path.write_text(DBC)
    return path


def write_trace(path, has_motor=True, ending=""):
    """Write the frames of an encoder, maybe with a motor between them."""
    with WRITERS[ending or path.suffix](str(path)) as writer:
        for t_s, count in zip(T_S, COUNTS, strict=True):
            data = struct.pack("<iBB", count, 0, 0)
            writer.on_message_received(frame(START_S + t_s, 385, data))
            if has_motor:
                writer.on_message_received(frame(START_S + t_s + 0.002, 641, bytes(2)))
    return path


def frame(stamp_s, can_id, data):
    """Make a data frame of the base format."""
    return can.Message(
        timestamp=stamp_s, arbitration_id=can_id, is_extended_id=False, data=data, channel=1
    )


@pytest.mark.parametrize("ending", sorted(WRITERS))
def test_every_kind_of_trace_gives_the_signal(tmp_path, dbc, ending):
    path = write_trace(tmp_path / f"trace{ending}")
    record = read_signal(path, ReadOptions(dbc=dbc, signal="Encoder.angle"))
    assert np.allclose(record.values, 1e-4 * COUNTS, atol=1e-12)
    assert np.allclose(record.t_s, T_S, atol=2e-3)
    assert record.unit == "rad"
    assert record.rate_hz == pytest.approx(100, rel=0.02)
    assert "Encoder (0x181)" in record.kind


def test_the_origin_of_a_trace_with_dates_is_kept(tmp_path, dbc):
    path = write_trace(tmp_path / "trace.log")
    record = read_signal(path, ReadOptions(dbc=dbc, field="angle"))
    assert record.t_s[0] == 0.0
    assert record.origin_s == pytest.approx(START_S)


def test_the_only_message_of_a_trace_needs_no_name(tmp_path, dbc):
    path = write_trace(tmp_path / "trace.log", has_motor=False)
    record = read_signal(path, ReadOptions(dbc=dbc))
    assert record.signal_source == "column 2 'Encoder.angle [rad]'"


def test_a_candump_under_another_name_is_known_by_its_lines(tmp_path, dbc):
    path = write_trace(tmp_path / "candump.txt", has_motor=False, ending=".log")
    assert read_signal(path, ReadOptions(dbc=dbc)).kind.startswith("CAN trace (candump)")


def test_a_trace_without_names_lists_its_identifiers(tmp_path):
    path = write_trace(tmp_path / "trace.blf")
    with pytest.raises(UnreadableData, match=r"0x181 \(120 frames\), 0x281.*--dbc"):
        read_signal(path)


def test_several_messages_are_listed_with_the_option_to_type(tmp_path, dbc):
    path = write_trace(tmp_path / "trace.asc")
    with pytest.raises(UnreadableData, match=r"Motor\.current: try --signal Encoder\.angle"):
        read_signal(path, ReadOptions(dbc=dbc))
    with pytest.raises(ConfigError, match=r"no such signal; signals found: Encoder\.angle"):
        read_signal(path, ReadOptions(dbc=dbc, signal="speed"))


def test_a_file_without_names_is_no_dbc(tmp_path):
    path = write_trace(tmp_path / "trace.log")
    with pytest.raises(ConfigError, match="--dbc"):
        read_signal(path, ReadOptions(dbc=tmp_path / "missing.dbc"))
    other = tmp_path / "other.dbc"
    other.write_text("nothing of the kind {")
    with pytest.raises(ConfigError, match="no DBC file"):
        read_signal(path, ReadOptions(dbc=other))


def test_a_dbc_file_for_a_text_is_a_mistake(tmp_path, dbc):
    path = tmp_path / "table.csv"
    path.write_text("\n".join(f"{t},{c}" for t, c in zip(T_S, COUNTS, strict=True)))
    with pytest.raises(ConfigError, match="leave out --dbc"):
        read_signal(path, ReadOptions(dbc=dbc))


def test_a_trace_cut_short_gives_what_is_before(tmp_path, dbc):
    path = write_trace(tmp_path / "trace.log", has_motor=False)
    text = path.read_text()
    path.write_text(text[: len(text) * 2 // 3] + "\n(17000")
    record = read_signal(path, ReadOptions(dbc=dbc))
    assert 60 < record.values.size < 100
    assert record.count("damaged") == 1
