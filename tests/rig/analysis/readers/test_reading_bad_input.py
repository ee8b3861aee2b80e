"""Bad input: named with its evidence and the option that mends it, or refused in plain words."""

import math
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.analysis.readers.errors import UnreadableData
from rig.analysis.readers.read import read_signal
from rig.analysis.readers.signal_record import ReadOptions
from rig.errors import ConfigError, RigError

T_S = 0.01 * np.arange(400)
ANGLE_RAD = 0.2 * np.exp(-0.05 * T_S) * np.cos(4.6 * T_S)


def write(path, t_s, values, header="t,angle", form="{:.6f}"):
    """Write a table of two columns."""
    rows = [f"{float(t)!r},{form.format(y)}" for t, y in zip(t_s, values, strict=True)]
    path.write_text("\n".join([header, *rows] if header else rows))
    return path


@pytest.fixture
def file(tmp_path):
    return tmp_path / "record.csv"


def finding(record, code):
    """Find the finding of a code."""
    found = [f for f in record.findings if f.code == code]
    assert found, record.findings
    return found[0]


def test_degrees_given_as_radians_are_refused(file):
    write(file, T_S, np.degrees(ANGLE_RAD))
    with pytest.raises(UnreadableData, match=r"11\.46 rad.*give --unit deg"):
        read_signal(file)
    record = read_signal(file, ReadOptions(unit="deg"))
    assert np.allclose(record.values, ANGLE_RAD, atol=1e-7)
    assert record.findings == ()


def test_a_swing_above_1_rad_may_be_degrees(file):
    write(file, T_S, np.degrees(ANGLE_RAD) / 8)
    assert "--unit deg" in finding(read_signal(file), "degrees_suspected").text


def test_an_unnamed_unit_of_an_angle_is_assumed_and_said(file):
    assert read_signal(write(file, T_S, ANGLE_RAD)).unit_source.startswith("assumed: 'angle'")


@pytest.mark.parametrize(("factor", "word"), [(1e3, "milli"), (1e6, "micro"), (1e9, "nano")])
def test_stamps_without_unit_are_taken_at_a_plausible_rate(file, factor, word):
    record = read_signal(write(file, factor * T_S, ANGLE_RAD))
    assert f"{word}seconds" in finding(record, "time_unit_assumed").text
    assert record.rate_hz == pytest.approx(100)
    assert f"{word}seconds assumed" in record.time_source


def test_a_second_between_samples_is_questioned_though_the_header_says_seconds(file):
    record = read_signal(write(file, 1e3 * T_S, ANGLE_RAD, "time (s),angle"))
    assert record.rate_hz == pytest.approx(0.1)
    assert "--rate 100" in finding(record, "slow_rate").text


def test_a_unix_time_is_counted_from_its_first_stamp(file):
    record = read_signal(write(file, 1.7e9 + 0.25 * np.arange(400), ANGLE_RAD))
    assert record.origin_s == 1.7e9
    assert record.t_s[0] == 0.0
    assert record.rate_hz == pytest.approx(4)


def test_two_rates_are_named_with_their_place(file):
    t_s = np.concatenate([T_S[:200], T_S[200] + 0.05 * np.arange(200)])
    record = read_signal(write(file, t_s, ANGLE_RAD))
    text = finding(record, "mixed_rates").text
    assert "100 Hz" in text
    assert "20 Hz" in text
    assert "--from" in text


def test_gaps_are_counted_and_the_longest_is_placed(file):
    keep = np.ones(T_S.size, dtype=bool)
    keep[100:120] = False
    keep[300:303] = False
    record = read_signal(write(file, T_S[keep], ANGLE_RAD[keep]))
    assert record.count("gaps") == 2
    assert "0.21 s at 0.99 s" in finding(record, "gaps").text
    assert record.rate_hz == pytest.approx(100)


def test_repeated_stamps_are_left_out_with_their_rows(file):
    t_s = T_S.copy()
    t_s[[50, 60]] = t_s[[49, 59]]
    record = read_signal(write(file, t_s, ANGLE_RAD))
    assert finding(record, "repeated_stamps").rows == (51, 61)
    assert record.dropped_rows == 2
    assert np.all(np.diff(record.t_s) > 0)


def test_a_backward_stamp_is_left_out_with_its_row(file):
    t_s = T_S.copy()
    t_s[70] -= 0.5
    record = read_signal(write(file, t_s, ANGLE_RAD))
    assert finding(record, "backward_stamps").rows == (71,)
    assert record.dropped_rows == 1


def test_one_stamp_far_ahead_does_not_hide_the_rest(file):
    t_s = T_S.copy()
    t_s[10] = 1e6
    record = read_signal(write(file, t_s, ANGLE_RAD))
    assert record.t_s.size >= 389
    assert finding(record, "backward_stamps").rows == (12,)


def test_a_clock_that_starts_again_leaves_the_longer_part(file):
    record = read_signal(write(file, np.concatenate([T_S[:150], T_S[:250]]), ANGLE_RAD))
    assert "rows 151 to 400" in finding(record, "backward_stamps").text
    assert record.t_s.size == 250


def test_text_in_the_numbers_is_named_by_row_and_column(file):
    lines = write(file, T_S, ANGLE_RAD).read_text().splitlines()
    lines[8] = "0.07,n/a"
    lines[20] = "0.19,"
    lines[30] = "0.29,nan"
    lines[40] = "0.39"
    file.write_text("\n".join(lines))
    record = read_signal(file)
    assert "row 8, column 2, 'n/a'" in finding(record, "text_cells").text
    assert finding(record, "non_finite").rows == (20, 30, 40)
    assert finding(record, "ragged_rows").rows == (40,)
    assert record.dropped_rows == 4


def test_a_second_header_within_the_data_is_left_out(file):
    lines = write(file, T_S, ANGLE_RAD).read_text().splitlines()
    file.write_text("\n".join([*lines[:201], lines[0], "", *lines[201:]]))
    record = read_signal(file)
    assert record.values.size == 400
    assert finding(record, "text_cells").rows == (201,)


def test_clipped_samples_are_counted(file):
    record = read_signal(write(file, T_S, np.minimum(ANGLE_RAD, 0.12), form="{:.17g}"))
    expected = int(np.sum(ANGLE_RAD >= 0.12))
    assert record.count("clipped") == expected
    assert "saturated" in finding(record, "clipped").text


@settings(max_examples=50)
@given(st.floats(0.01, 0.3), st.floats(0.5, 8), st.floats(0, 6), st.sampled_from([3, 4, 6, 9]))
def test_a_rounded_decay_is_not_taken_for_a_clipped_one(
    tmp_path_factory, amplitude, rate_rad_s, phase, decimals
):
    path = tmp_path_factory.mktemp("clip") / "record.csv"
    values = amplitude * np.exp(-0.1 * T_S) * np.cos(rate_rad_s * T_S + phase)
    write(path, T_S, values, form=f"{{:.{decimals}f}}")
    assert read_signal(path).count("clipped") == 0


def test_a_constant_is_named(file):
    record = read_signal(write(file, T_S, 0 * T_S + 0.3), ReadOptions(signal="angle"))
    assert "constant" in finding(record, "constant").text
    assert record.quantum == 0.0


def test_a_file_of_constants_has_no_signal(file):
    write(file, T_S, 0 * T_S + 0.3)
    with pytest.raises(UnreadableData, match="no column with a signal"):
        read_signal(file)


def test_noise_and_quantum_are_estimated(file):
    noise = np.random.default_rng(1).normal(0, 2e-3, T_S.size)
    record = read_signal(write(file, T_S, ANGLE_RAD + noise))
    assert record.noise_floor == pytest.approx(2e-3, rel=0.15)
    rounded = read_signal(write(file, T_S, ANGLE_RAD, form="{:.3f}"))
    assert rounded.quantum == pytest.approx(1e-3)
    assert rounded.noise_floor >= 1e-3 / math.sqrt(12) * 0.999


def test_a_count_of_samples_is_no_time(file):
    write(file, np.arange(400), ANGLE_RAD, "sample,angle")
    with pytest.raises(UnreadableData, match=r"counts the samples.*--rate HZ"):
        read_signal(file)
    assert read_signal(file, ReadOptions(rate_hz=100)).rate_hz == pytest.approx(100)


def test_a_single_column_needs_a_rate(file):
    file.write_text("\n".join(f"{y:.6f}" for y in ANGLE_RAD))
    with pytest.raises(UnreadableData, match="try --rate HZ"):
        read_signal(file)


def test_a_rate_that_contradicts_the_stamps_is_said(file):
    record = read_signal(write(file, T_S, ANGLE_RAD), ReadOptions(rate_hz=50))
    assert "100 Hz" in finding(record, "rate_mismatch").text
    assert record.signal_source == "column 2 'angle'"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"signal": "speed"}, r"--signal speed: no such column.*1 't', 2 'angle'"),
        ({"signal": "3"}, "number from 1 to 2"),
        ({"signal": "1"}, "column 1 't' is the time"),
        ({"time": "clock"}, "--time clock"),
        ({"unit": "furlong"}, "must be one of rad, deg"),
        ({"rate_hz": -5.0}, "must be > 0"),
        ({"rate_hz": 5.0, "time": "1"}, "must be one of them"),
    ],
)
def test_an_option_that_does_not_fit_is_a_mistake_of_the_user(file, options, message):
    write(file, T_S, ANGLE_RAD)
    with pytest.raises(ConfigError, match=message):
        read_signal(file, ReadOptions(**options))


def test_a_time_that_does_not_rise_is_refused(file):
    write(file, 1.0 - T_S, ANGLE_RAD)
    with pytest.raises(UnreadableData, match="does not rise"):
        read_signal(file, ReadOptions(time="1"))


@pytest.mark.parametrize(
    ("head", "word"),
    [
        (b"\0\0\0\x18ftypmp42", "a video"),
        (b"RIFF\x10\0\0\0AVI LIST", "a video"),
        (b"\x1aE\xdf\xa3\x93", "a video"),
        (b"\x89PNG\r\n\x1a\n\0\0", "a picture"),
        (b"\xff\xd8\xff\xe0\0", "a picture"),
        (b"%PDF-1.7\n", "a PDF"),
        (b"\x1f\x8b\x08\0", "gunzip"),
        (b"SQLite format 3\0", "MCAP"),
        (b"\x93NUMPY\x01\0", "NumPy"),
        (b"\x01\xfe\0\x80\0\0", "unknown kind"),
        (b"", "empty"),
        (b"\n\r\n ", "empty"),
        (b"once upon a time\nthere was a load\nthat hung\n", "no table of numbers"),
    ],
)
def test_a_file_without_a_table_is_named(file, head, word):
    file.write_bytes(head + (bytes(64) if b"\0" in head else b""))
    with pytest.raises(UnreadableData, match=word):
        read_signal(file)


def test_a_missing_file_and_an_empty_folder_are_named(tmp_path):
    with pytest.raises(UnreadableData, match="No such file"):
        read_signal(tmp_path / "nothing.csv")
    with pytest.raises(UnreadableData, match=r"a folder without run\.mcap; it holds nothing"):
        read_signal(tmp_path)


@given(
    data=st.binary(max_size=400),
    start=st.sampled_from(
        [
            b"",
            b"t,y\n",
            b"1,2\n3,4\n5,6\n",
            b"PK\x03\x04",
            b"\x89MCAP0\r\n",
            b"MATLAB 5.0",
            b"LOGG",
            b"<phyphox>",
        ]
    ),
)
def test_any_bytes_end_in_a_record_or_a_message(tmp_path_factory, data, start):
    path = tmp_path_factory.mktemp("bytes") / "file.dat"
    path.write_bytes(start + data)
    with suppress(UnreadableData, RigError):
        assert read_signal(path, ReadOptions(rate_hz=100.0)).values.size
