"""`rig recover` and `rig export`: damaged logs become complete files, logs become tables."""

import csv
import json
from pathlib import Path

import pytest

from comms.mcap_log import read_log

OLD_LOG = Path(__file__).parents[2] / "data" / "logs" / "e295f92_move_virtual.mcap"


def cut(folder, share=0.6):
    """A log that ends after a share of its bytes."""
    path = folder / "cut.mcap"
    data = OLD_LOG.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    return path


def rows_of(path):
    """Rows of a CSV file."""
    with path.open() as file:
        return list(csv.DictReader(file))


def test_a_cut_log_is_recovered_and_what_is_lost_is_said(rig, tmp_path):
    code, out, _ = rig("recover", cut(tmp_path), "mended.mcap")
    assert code == 0
    assert "written: mended.mcap" in out
    assert "left out: 1 damaged or cut chunks" in out
    assert len(read_log(tmp_path / "mended.mcap").topics["/angle_1"]) > 100


def test_a_recovery_as_json_has_the_counts(rig, tmp_path):
    code, out, _ = rig("recover", OLD_LOG, "mended.mcap", "--json")
    document = json.loads(out)
    assert code == 0
    assert document["whole"]
    assert document["messages"] == sum(map(len, read_log(OLD_LOG).topics.values()))


def test_a_file_that_is_no_log_is_not_recovered(rig, tmp_path):
    (tmp_path / "x.mcap").write_text("no log")
    code, _, err = rig("recover", "x.mcap", "mended.mcap")
    assert code == 6
    assert "no intact record of an MCAP file in 6 bytes" in err


def test_every_channel_becomes_a_csv_table_with_a_row_for_each_message(rig, tmp_path):
    code, out, _ = rig("export", OLD_LOG, "--csv", "tables")
    topics = read_log(OLD_LOG).topics
    assert code == 0
    assert f"{len(topics)} tables written to tables" in out
    angles = rows_of(tmp_path / "tables" / "angle_1.csv")
    messages = [json.loads(entry.data) for entry in topics["/angle_1"]]
    assert [row["seq"] for row in angles] == [str(message["seq"]) for message in messages]
    cable = messages[200]["links"][0]
    assert float(angles[200]["links_0_angle_rad"]) == cable["angle_rad"]
    assert float(angles[200]["links_0_raw_rad"]) == cable["raw_rad"]
    robot = rows_of(tmp_path / "tables" / "robot_state.csv")
    assert float(robot[-1]["actual_m_0"]) == pytest.approx(0.2, abs=1e-3)


def test_receipts_become_one_row_each_and_pictures_become_files(rig, tmp_path):
    rig("export", OLD_LOG, "--csv", "tables")
    receipts = rows_of(tmp_path / "tables" / "receipts_angle_1.csv")
    assert len(receipts) == 455
    assert {"seq", "t_rx_ns", "outcome"} <= set(receipts[0])
    pictures = rows_of(tmp_path / "tables" / "camera_image.csv")
    files = [tmp_path / "tables" / row["data"] for row in pictures]
    assert files
    assert all(file.read_bytes().startswith(b"\xff\xd8\xff") for file in files)


def test_parquet_tables_hold_what_the_csv_tables_hold(rig, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    code, _, _ = rig("export", OLD_LOG, "--parquet", "p", "--csv", "c")
    assert code == 0
    table = parquet.read_table(tmp_path / "p" / "setpoint.parquet").to_pydict()
    rows = rows_of(tmp_path / "c" / "setpoint.csv")
    for name in ("values_0", "values_1", "values_2"):
        assert table[name] == [float(row[name]) for row in rows]
    assert len(rows) == 1799


def test_an_export_without_a_folder_is_refused(rig):
    code, _, err = rig("export", OLD_LOG)
    assert code == 2
    assert "neither --csv DIR nor --parquet DIR" in err


def test_the_tables_of_a_cut_log_are_written_and_the_cut_is_said(rig, tmp_path):
    code, out, _ = rig("export", cut(tmp_path), "--csv", "tables")
    assert code == 6
    assert "the log is incomplete" in out
    assert (tmp_path / "tables" / "angle_1.csv").is_file()
