"""Files of other programs: MATLAB, Excel and phyphox, written without the readers."""

import importlib.util
import random
import sys
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from rig.analysis.readers.errors import UnreadableData
from rig.analysis.readers.read import read_signal
from rig.analysis.readers.signal_record import ReadOptions
from rig.errors import ConfigError

T_S = 0.01 * np.arange(60)
ANGLE_RAD = 0.2 * np.cos(4.6 * T_S)


def write_xls(path, name, rows):
    """Write a workbook with the module beside this test."""
    place = Path(__file__).with_name("excel_file.py")
    spec = importlib.util.spec_from_file_location("excel_file", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.write_xls(path, name, rows)


def test_vectors_of_a_matlab_file_are_columns(tmp_path):
    path = tmp_path / "swing.mat"
    scipy.io.savemat(path, {"t": T_S, "theta_deg": np.degrees(ANGLE_RAD), "L": 0.46})
    record = read_signal(path)
    assert np.allclose(record.values, ANGLE_RAD)
    assert np.array_equal(record.t_s, T_S)
    assert record.unit_source == "header 'theta_deg'"


def test_a_matlab_file_of_version_4_is_read(tmp_path):
    path = tmp_path / "old.mat"
    scipy.io.savemat(path, {"time": T_S, "x_mm": 1e3 * ANGLE_RAD}, format="4")
    assert np.allclose(read_signal(path).values, ANGLE_RAD)


def test_structures_and_matrices_of_a_matlab_file_are_unfolded(tmp_path):
    path = tmp_path / "log.mat"
    matrix = np.stack([0 * T_S, ANGLE_RAD], axis=1)
    scipy.io.savemat(path, {"log": {"time": T_S, "signals": {"values": matrix}}})
    record = read_signal(path)
    assert record.signal_source == "column 3 'log.signals.values(:,2)'"
    assert np.array_equal(record.values, ANGLE_RAD)


def test_a_sampling_rate_in_a_matlab_file_stands_for_time(tmp_path):
    path = tmp_path / "rate.mat"
    scipy.io.savemat(path, {"angle_rad": ANGLE_RAD, "Fs": 100.0})
    record = read_signal(path)
    assert record.rate_hz == pytest.approx(100)
    assert record.time_source == "100 Hz, variable 'Fs'"


def test_a_matlab_file_without_numbers_lists_its_variables(tmp_path):
    path = tmp_path / "text.mat"
    scipy.io.savemat(path, {"note": "a swing"})
    with pytest.raises(UnreadableData, match="variables found: note"):
        read_signal(path)


def test_a_matlab_file_of_version_7_3_is_read(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "new.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = T_S[np.newaxis, :]
        file["run/angle_rad"] = ANGLE_RAD[np.newaxis, :]
        file["run/note"] = np.arange(70, 130, dtype=np.uint16)[:, np.newaxis]
        file["run/note"].attrs["MATLAB_class"] = b"char"
    data = bytearray(path.read_bytes())
    data[:19] = b"MATLAB 7.3 MAT-file"
    path.write_bytes(data)
    record = read_signal(path)
    assert record.kind == "MATLAB file v7.3"
    assert len(record.columns) == 2
    assert record.signal_source == "column 1 'run.angle_rad'"
    assert np.array_equal(record.values, ANGLE_RAD)


def test_a_missing_extra_is_named_with_its_command(tmp_path, monkeypatch):
    path = tmp_path / "new.mat"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(UnreadableData, match=r"pip install 'swayless\[formats\]'"):
        read_signal(path)


def test_the_sheet_with_numbers_of_a_workbook_is_read(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    path = tmp_path / "swing.xlsx"
    book = openpyxl.Workbook()
    book.active.append(["notes of the day"])
    sheet = book.create_sheet("Raw Data")
    sheet.append(["Time (s)", "Angle (deg)"])
    for row in zip(T_S, np.degrees(ANGLE_RAD), strict=True):
        sheet.append([float(value) for value in row])
    book.save(path)
    record = read_signal(path)
    assert record.kind == "Excel workbook, sheet 'Raw Data'"
    assert np.allclose(record.values, ANGLE_RAD, atol=1e-15)
    assert record.layout == "numbers from row 2"
    with pytest.raises(ConfigError, match="sheets found: Sheet, Raw Data"):
        read_signal(path, ReadOptions(topic="Data"))


def test_an_old_workbook_is_read(tmp_path):
    pytest.importorskip("xlrd")
    path = tmp_path / "swing.xls"
    rows = [["Time (s)", "Voltage (V)"], *zip(T_S.tolist(), ANGLE_RAD.tolist(), strict=True)]
    write_xls(path, "Data", rows)
    record = read_signal(path)
    assert record.kind == "Excel workbook, sheet 'Data'"
    assert record.unit == "V"
    assert np.array_equal(record.values, ANGLE_RAD)


def test_a_text_named_xls_is_read_as_text(tmp_path):
    path = tmp_path / "export.xls"
    rows = [f"{t:.2f}\t{y:.6f}" for t, y in zip(T_S, ANGLE_RAD, strict=True)]
    path.write_text("\n".join(["t\tangle_rad", *rows]))
    assert read_signal(path).kind == "text"


def phyphox_csv():
    """Table as phyphox exports it."""
    head = '"Time (s)","Acceleration x (m/s^2)","Absolute acceleration (m/s^2)"'
    rows = [f"{t:.9E},{y:.9E},{9.8 + abs(y):.9E}" for t, y in zip(T_S, ANGLE_RAD, strict=True)]
    return "\n".join([head, *rows])


def test_a_phyphox_archive_gives_its_table(tmp_path):
    path = tmp_path / "export.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("Raw Data.csv", phyphox_csv())
        archive.writestr("meta/device.csv", '"property","value"\n"version","1.1.12"\n')
        archive.writestr("meta/time.csv", '"event","experiment time"\n"START",0.0\n')
    record = read_signal(path)
    assert record.signal_source == "column 2 'Acceleration x (m/s^2)'"
    assert record.unit == "m/s2"
    assert np.allclose(record.values, ANGLE_RAD, atol=1e-9)


def test_an_archive_of_several_tables_asks_for_one(tmp_path):
    path = tmp_path / "export.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("Accelerometer.csv", phyphox_csv())
        archive.writestr("Gyroscope.csv", phyphox_csv())
    with pytest.raises(UnreadableData, match=r"try --topic 'Accelerometer\.csv'"):
        read_signal(path)
    record = read_signal(path, ReadOptions(topic="Gyroscope"))
    assert record.kind == "archive, file 'Gyroscope.csv'"


def experiment(init):
    """Phyphox experiment with two buffers."""
    t, y = (",".join(f"{v:.9e}" for v in values) if init else "" for values in (T_S, ANGLE_RAD))
    return (
        '<phyphox version="1.14"><title>Pendulum</title><data-containers>'
        f'<container size="0" init="{t}">gyr_time</container>'
        f'<container size="0" init="{y}">gyrZ</container></data-containers>'
        '<export><set name="Raw Data"><data name="Time (s)">gyr_time</data>'
        '<data name="Gyroscope z (rad/s)">gyrZ</data></set></export></phyphox>'
    )


def test_a_phyphox_experiment_saved_with_its_data_is_read(tmp_path):
    path = tmp_path / "pendulum.phyphox"
    path.write_text(experiment(init=True))
    record = read_signal(path)
    assert record.unit == "rad/s"
    assert np.allclose(record.values, ANGLE_RAD, atol=1e-9)


def test_a_phyphox_experiment_without_data_is_refused(tmp_path):
    path = tmp_path / "pendulum.phyphox"
    path.write_text(experiment(init=False))
    with pytest.raises(UnreadableData, match="without data"):
        read_signal(path)


def damaged(data, rng):
    """Cut a file short, or change some of its bytes."""
    broken = bytearray(data)
    if rng.random() < 0.4:
        return bytes(broken[: rng.randrange(1, len(broken))])
    for _ in range(rng.choice([1, 3, 30])):
        broken[rng.randrange(len(broken))] = rng.randrange(256)
    return bytes(broken)


def matlab_file(path):
    """Write a MATLAB file with vectors, a structure, a cell and complex numbers."""
    log = {"t": T_S, "y": ANGLE_RAD, "name": "swing", "cell": [1, "x"]}
    scipy.io.savemat(path, {"log": log, "spectrum": 1j * T_S})


def workbook_xlsx(path):
    """Write a workbook of two columns."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in zip(T_S.tolist(), ANGLE_RAD.tolist(), strict=True):
        book.active.append(row)
    book.save(path)


def workbook_xls(path):
    """Write an old workbook of two columns."""
    pytest.importorskip("xlrd")
    write_xls(path, "Data", list(zip(T_S.tolist(), ANGLE_RAD.tolist(), strict=True)))


def archive(path):
    """Write an archive with one table."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("Raw Data.csv", phyphox_csv())


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.mat", matlab_file),
        ("a.xlsx", workbook_xlsx),
        ("a.xls", workbook_xls),
        ("a.zip", archive),
    ],
)
def test_a_damaged_file_ends_in_a_record_or_a_message(tmp_path, name, write):
    path = tmp_path / name
    write(path)
    data = path.read_bytes()
    rng = random.Random(1)
    for _ in range(60):
        path.write_bytes(damaged(data, rng))
        with suppress(UnreadableData):
            assert read_signal(path, ReadOptions(rate_hz=100.0)).values.size
