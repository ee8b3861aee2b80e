"""MCAP files: a run of ours, JSON of other programs, and ROS 2."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer

from comms.mcap_log import read_log
from comms.messages import AngleSample
from rig.analysis.readers.errors import UnreadableData
from rig.analysis.readers.read import read_signal
from rig.analysis.readers.signal_record import ReadOptions
from rig.analysis.seen_swing import averaged
from rig.errors import ConfigError

OWN = Path(__file__).parents[3] / "data" / "logs" / "e295f92_move_virtual.mcap"
T_S = 0.02 * np.arange(100)
RATE_RAD_S = 0.3 * np.cos(4.6 * T_S)
EPOCH_NS = 1_700_000_000_000_000_000


def test_a_run_of_ours_gives_its_valid_angles():
    record = read_signal(OWN)
    swing = averaged(read_log(OWN).read("/angle_1", AngleSample))
    assert np.allclose(record.t_s, swing.t_s)
    assert np.array_equal(record.values, swing.angle_rad)
    assert record.unit == "rad"
    assert record.signal_source == "column 2 'links[0].angle_rad'"
    assert "t_valid_ns" in record.time_source


def test_a_run_folder_gives_its_log(tmp_path):
    shutil.copy(OWN, tmp_path / "run.mcap")
    assert np.array_equal(read_signal(tmp_path).values, read_signal(OWN).values)


def test_another_topic_of_a_run_is_read_by_its_field():
    options = ReadOptions(topic="/robot_state", field="actual_m[0]")
    record = read_signal(OWN, options)
    assert "t_actual_ns" in record.time_source
    assert record.rate_hz == pytest.approx(100, rel=0.01)
    with pytest.raises(ConfigError, match=r"topics found: .*/robot_state.*try --topic"):
        read_signal(OWN, ReadOptions(topic="/wheel"))


def test_a_run_log_cut_short_gives_what_is_left_and_says_so(tmp_path):
    path = tmp_path / "cut.mcap"
    path.write_bytes(OWN.read_bytes()[: OWN.stat().st_size // 2])
    record = read_signal(path)
    assert record.count("damaged") == 1
    assert 8 <= record.values.size < read_signal(OWN).values.size


def write_json(path, topics, index=IndexType.ALL):
    """Write messages of topics as JSON, stamped every 20 ms."""
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD, index_types=index)
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        for topic, messages in topics.items():
            channel = writer.register_channel(topic, "json", schema)
            for k, message in enumerate(messages):
                log_ns = EPOCH_NS + k * 20_000_000 + (k % 3) * 1_000_000
                writer.add_message(channel, log_ns, json.dumps(message).encode(), log_ns)
        writer.finish()


def imu(k, stamped=True):
    """Message of an inertial sensor."""
    stamp_ns = EPOCH_NS + round(T_S[k] * 1e9)
    header = {"stamp": {"sec": stamp_ns // 10**9, "nanosec": stamp_ns % 10**9}, "frame_id": "imu"}
    rates = {"x": 0.0, "y": 0.0, "z": RATE_RAD_S[k]}
    return {"header": header if stamped else {}, "valid": True, "angular_velocity": rates}


@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE])
def test_json_of_another_program_is_read_by_the_stamps_in_it(tmp_path, index):
    path = tmp_path / "imu.mcap"
    write_json(path, {"/imu": [imu(k) for k in range(100)]}, index)
    record = read_signal(path)
    assert np.allclose(record.t_s, T_S, atol=1e-12)
    assert np.array_equal(record.values, RATE_RAD_S)
    assert record.unit == "rad/s"
    assert record.origin_s == pytest.approx(EPOCH_NS * 1e-9)
    assert "REP 103" in record.unit_source


def test_messages_without_stamps_take_the_instant_of_recording(tmp_path):
    path = tmp_path / "imu.mcap"
    write_json(path, {"/imu": [imu(k, stamped=False) for k in range(100)]})
    record = read_signal(path, ReadOptions(field="angular_velocity.z"))
    assert record.time_source == "column 1 'log time [s]'"
    assert record.t_s[1] == pytest.approx(0.021)


def test_several_topics_are_listed_with_the_options_to_type(tmp_path):
    path = tmp_path / "many.mcap"
    write_json(path, {"/note": [{"text": "hello"}], "/imu": [imu(k) for k in range(100)]})
    with pytest.raises(UnreadableData, match=r"--topic /imu --field angular_velocity\.x"):
        read_signal(path)
    record = read_signal(path, ReadOptions(topic="/imu", field="angular_velocity.z"))
    assert record.values.size == 100
    with pytest.raises(ConfigError, match=r"columns found.*angular_velocity\.z"):
        read_signal(path, ReadOptions(topic="/imu", field="speed"))


def test_an_unknown_encoding_is_named(tmp_path):
    path = tmp_path / "proto.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("Imu", "protobuf", b"")
        channel = writer.register_channel("/imu", "protobuf", schema)
        writer.add_message(channel, 1, b"\0", 1)
        writer.finish()
    with pytest.raises(UnreadableData, match=r"/imu \(protobuf, 1\)"):
        read_signal(path)


def test_a_message_of_ros_2_is_read(tmp_path):
    ros2 = pytest.importorskip("mcap_ros2.writer")
    path = tmp_path / "ros2.mcap"
    text = (
        "std_msgs/Header header\nfloat64 angle\n"
        "================================================================================\n"
        "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        "================================================================================\n"
        "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    with path.open("wb") as stream:
        writer = ros2.Writer(stream)
        schema = writer.register_msgdef("rig_msgs/msg/Angle", text)
        for k in range(100):
            stamp_ns = EPOCH_NS + k * 20_000_000
            stamp = {"sec": stamp_ns // 10**9, "nanosec": stamp_ns % 10**9}
            message = {"header": {"stamp": stamp, "frame_id": "a"}, "angle": RATE_RAD_S[k]}
            writer.write_message("/angle", schema, message, stamp_ns, stamp_ns)
        writer.finish()
    record = read_signal(path)
    assert np.allclose(record.t_s, T_S, atol=1e-12)
    assert np.array_equal(record.values, RATE_RAD_S)
    assert record.unit == "rad"
    assert record.unit_source.startswith("assumed")
