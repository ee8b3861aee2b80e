"""Text tables: any delimiter, decimal mark, header, line end and encoding gives the numbers."""

import csv
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.analysis.readers.errors import UnreadableData
from rig.analysis.readers.read import read_signal
from rig.analysis.readers.signal_record import ReadOptions

T_S = 0.01 * np.arange(40)
ANGLE_RAD = 0.2 * np.cos(4.6 * T_S)
HEADERS = {
    "none": [],
    "names": [["time", "angle"]],
    "units": [["Time (s)", "Angle (rad)"]],
    "two lines": [["time", "angle"], ["s", "rad"]],
    "preamble": [["Swing of a load"], ["measured by hand"], [], ["t [s]", "phi [rad]"]],
}


def text_of(rows, delimiter, decimal, header, line_end, quote=""):
    """Write a table as text, without any code of the reader."""
    lines = [delimiter.join(cells) for cells in HEADERS[header]]
    for row in rows:
        cells = [f"{quote}{repr(float(value)).replace('.', decimal)}{quote}" for value in row]
        lines.append(delimiter.join(cells))
    return line_end.join([*lines, ""])


values = st.floats(-1.0, 1.0, allow_subnormal=False)


@settings(max_examples=150)
@given(
    signal=st.lists(values, min_size=12, max_size=30),
    delimiter=st.sampled_from([",", ";", "\t", "|", " ", "   "]),
    decimal=st.sampled_from([".", ","]),
    header=st.sampled_from(sorted(HEADERS)),
    line_end=st.sampled_from(["\n", "\r\n", "\r"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "latin-1", "utf-16", "utf-16-le"]),
    is_quoted=st.booleans(),
)
def test_every_form_of_a_table_gives_back_its_numbers(
    tmp_path_factory, signal, delimiter, decimal, header, line_end, encoding, is_quoted
):
    if delimiter == decimal:
        is_quoted = True
    t_s = 0.02 * np.arange(len(signal)) + 0.5
    quote = '"' if is_quoted else ""
    text = text_of(zip(t_s, signal, strict=True), delimiter, decimal, header, line_end, quote)
    path = tmp_path_factory.mktemp("text") / "table.txt"
    path.write_bytes(text.encode(encoding))
    record = read_signal(path, ReadOptions(time="1", signal="2", unit="none"))
    assert np.array_equal(record.t_s, t_s)
    assert np.array_equal(record.values, signal)


@given(signal=st.lists(values, min_size=12, max_size=30), decimal=st.sampled_from([".", ","]))
def test_one_column_with_a_rate_gives_back_its_numbers(tmp_path_factory, signal, decimal):
    path = tmp_path_factory.mktemp("text") / "column.txt"
    path.write_text("\n".join(f"{value:+.17f}".replace(".", decimal) for value in signal))
    if len(set(signal)) == 1:
        return
    record = read_signal(path, ReadOptions(rate_hz=50.0, signal="1"))
    assert np.allclose(record.values, signal, rtol=0, atol=1e-16)
    assert record.rate_hz == pytest.approx(50)


def test_the_csv_module_of_python_is_understood(tmp_path):
    path = tmp_path / "quoted.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file, quoting=csv.QUOTE_ALL)
        writer.writerow(["Time (ms)", "Acceleration, along x (m/s^2)"])
        writer.writerows([(1000 * t, 3 * y) for t, y in zip(T_S, ANGLE_RAD, strict=True)])
    record = read_signal(path)
    assert record.unit == "m/s2"
    assert np.allclose(record.t_s, T_S)
    assert np.array_equal(record.values, 3 * ANGLE_RAD)


def test_numpy_savetxt_is_understood(tmp_path):
    path = tmp_path / "numpy.txt"
    np.savetxt(path, np.stack([T_S, ANGLE_RAD], axis=1), header="t_s angle_rad")
    record = read_signal(path)
    assert record.unit == "rad"
    assert np.array_equal(record.values, ANGLE_RAD)
    assert record.columns == ("1 't_s'", "2 'angle_rad'")


def test_delimiters_at_the_line_ends_make_no_column(tmp_path):
    path = tmp_path / "ends.csv"
    rows = [f"{t:.2f};{y:.5f};" for t, y in zip(T_S, ANGLE_RAD, strict=True)]
    path.write_text("\n".join(["t;U in V;", *rows]))
    record = read_signal(path)
    assert record.unit == "V"
    assert len(record.columns) == 2


def test_marks_between_thousands_are_no_decimal_marks(tmp_path):
    path = tmp_path / "thousands.tsv"
    rows = [f"{t:.2f}\t{1234.5 + y:,.3f}" for t, y in zip(T_S, ANGLE_RAD, strict=True)]
    path.write_text("\n".join(rows))
    record = read_signal(path)
    assert np.allclose(record.values, 1234.5 + ANGLE_RAD, atol=1e-3)


def test_headerless_integers_with_leading_zeros_are_decimal_commas(tmp_path):
    path = tmp_path / "comma.txt"
    path.write_text("\n".join(f"{y:.3f}".replace(".", ",") for y in ANGLE_RAD))
    record = read_signal(path, ReadOptions(rate_hz=100))
    assert np.allclose(record.values, ANGLE_RAD, atol=5e-4)
    assert "decimal comma" in record.layout


def test_integers_under_a_header_of_two_names_are_two_columns(tmp_path):
    path = tmp_path / "counts.csv"
    counts = np.round(2000 * ANGLE_RAD).astype(int)
    lines = [f"{10 * k},{count}" for k, count in enumerate(counts)]
    path.write_text("\n".join(["t_ms,count", *lines]))
    record = read_signal(path)
    assert np.array_equal(record.values, counts)
    assert record.rate_hz == pytest.approx(100)


def test_times_of_day_and_dates_become_seconds(tmp_path):
    for name, start in (("day", "12:59:"), ("date", "2024-03-01 12:59:")):
        path = tmp_path / f"{name}.csv"
        rows = [f"{start}{50 * t / 0.4:06.3f};{y:.5f}" for t, y in zip(T_S, ANGLE_RAD, strict=True)]
        path.write_text("\n".join(["when;angle_rad", *rows]))
        record = read_signal(path)
        assert record.rate_hz == pytest.approx(0.8)
        assert np.allclose(record.values, ANGLE_RAD, atol=1e-5)
    assert record.t_s[0] == 0.0
    assert record.origin_s == 1709297940.0  # 2024-03-01 12:59 UTC


def test_columns_of_text_are_left_out(tmp_path):
    path = tmp_path / "state.csv"
    rows = [f"{t:.2f},OK,{y:.5f}" for t, y in zip(T_S, ANGLE_RAD, strict=True)]
    path.write_text("\n".join(["t,state,theta", *rows]))
    record = read_signal(path)
    assert record.signal_source == "column 3 'theta'"
    assert record.findings == ()


def test_a_labview_measurement_gives_rate_and_unit(tmp_path):
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
        "X_Columns\tOne\n***End_of_Header***\t\n\nChannels\t1\t\nSamples\t40\t\n"
        "Y_Unit_Label\tVolts\t\nX_Dimension\tTime\t\nX0\t0.0E+0\t\nDelta_X\t0.010000\t\n"
        "***End_of_Header***\t\t\nX_Value\tVoltage_0\tComment\n"
    )
    rows = [f"{t:.6f}\t{y:.6f}" for t, y in zip(T_S, ANGLE_RAD, strict=True)]
    path = tmp_path / "scope.lvm"
    path.write_text(head + "\n".join(rows))
    record = read_signal(path)
    assert record.kind == "LabVIEW measurement (.lvm)"
    assert record.unit == "V"
    assert record.rate_hz == pytest.approx(100)
    assert np.allclose(record.values, ANGLE_RAD, atol=1e-6)


def test_a_labview_measurement_without_time_takes_its_step(tmp_path):
    head = "LabVIEW Measurement\t\nDelta_X\t0.020000\t\n***End_of_Header***\t\nX_Value\tUntitled\n"
    rows = [f"\t{y:.6f}" for y in ANGLE_RAD]
    path = tmp_path / "scope.lvm"
    path.write_text(head + "\n".join(rows))
    record = read_signal(path)
    assert record.rate_hz == pytest.approx(50)
    assert np.allclose(record.values, ANGLE_RAD, atol=1e-6)


def test_a_klipper_accelerometer_is_in_millimetres(tmp_path):
    path = tmp_path / "raw_data_x.csv"
    rows = [
        f"{57 + t:.6f},{1e3 * y:.6f},9800.0,{y:.6f}" for t, y in zip(T_S, ANGLE_RAD, strict=True)
    ]
    path.write_text("\n".join(["#time,accel_x,accel_y,accel_z", *rows]))
    record = read_signal(path)
    assert record.unit == "m/s2"
    assert "Klipper" in record.unit_source
    assert np.allclose(record.values, ANGLE_RAD, atol=1e-9)


def test_a_power_spectral_density_is_refused_by_name(tmp_path):
    path = tmp_path / "resonances_x.csv"
    rows = [f"{5 + k:.1f},{k:.3e},{2 * k:.3e},1.0e-3,{3 * k:.3e}" for k in range(40)]
    path.write_text("\n".join(["freq,psd_x,psd_y,psd_z,psd_xyz", *rows]))
    with pytest.raises(UnreadableData, match=r"power spectral density over frequency.*raw_data"):
        read_signal(path)


def test_a_long_table_needs_little_more_memory_than_its_numbers(tmp_path):
    count = 400_000
    path = tmp_path / "long.csv"
    t_s = np.arange(count) / 1000
    np.savetxt(path, np.stack([t_s, np.cos(t_s)], axis=1), "%.4f", ";")
    tracemalloc.start()
    record = read_signal(path)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert record.rows == count
    assert peak_bytes < 10 * path.stat().st_size
