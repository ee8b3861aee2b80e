"""A log opens in three readers: mcap as pinned, mcap 1.3.1, and @mcap/core under Node."""

import base64
import json
import random
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from comms.errors import LogError
from comms.log_recovery import recover
from comms.mcap_log import read_log

HERE = Path(__file__).parent
OLD_LOG = HERE.parent / "data" / "logs" / "e295f92_move_virtual.mcap"
RENAMED = {"platform": "platform_1", "frame": "frame_1", "angle": "angle_1"}  # in version 2
OLD_READER = "mcap==1.3.1"
NODE_PACKAGES = ("@mcap/core@2.2.2", "fzstd@0.1.1")
INSTALL_S = 120
READ_S = 60
SHORT = ["experiment.quiet_s=0.5", "experiment.watch_s=2.5", "record.pictures_hz=2"]

pytestmark = pytest.mark.xdist_group("readers")


def run(command, timeout_s, cwd=None):
    """Run a command; its output and exit code."""
    return subprocess.run(
        [str(word) for word in command],
        capture_output=True, text=True, check=False, timeout=timeout_s, cwd=cwd,
    )  # fmt: skip


@pytest.fixture(scope="session")
def pinned():
    """Command of the reader as pinned."""
    return [sys.executable, HERE / "read_mcap.py"]


@pytest.fixture(scope="session")
def old(tmp_path_factory):
    """Command of mcap 1.3.1 in an environment of its own; skips where it cannot be installed."""
    folder = tmp_path_factory.mktemp("old_reader")
    run([sys.executable, "-m", "venv", folder], INSTALL_S)
    python = folder / "bin" / "python"
    installed = run([python, "-m", "pip", "install", "-q", OLD_READER], INSTALL_S)
    if installed.returncode:
        pytest.skip(f"{OLD_READER} cannot be installed here: {installed.stderr[-200:]}")
    return [python, HERE / "read_mcap.py"]


@pytest.fixture(scope="session")
def node(tmp_path_factory):
    """Command of @mcap/core under Node; skips where Node or its packages are missing."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("Node is not installed here: @mcap/core is not tried")
    folder = tmp_path_factory.mktemp("node_reader")
    command = ["npm", "install", "--silent", "--no-fund", "--no-audit", *NODE_PACKAGES]
    installed = run(command, INSTALL_S, cwd=folder)
    if installed.returncode:
        pytest.skip(f"@mcap/core cannot be installed here: {installed.stderr[-200:]}")
    return ["node", HERE / "read_mcap.mjs", "LOG", folder]


@pytest.fixture(params=["pinned", "old", "node"])
def reader(request):
    """Each reader in turn: file -> what it found."""
    command = request.getfixturevalue(request.param)

    def read(path):
        words = [path if word == "LOG" else word for word in command]
        if "LOG" not in command:
            words.append(path)
        done = run(words, READ_S)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return read


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """One log of every kind: a whole run, a killed one recovered, an old one recovered."""
    from rig.run import experiment
    from rig.run.config import read_experiment
    from rig.run.runs import LOG

    runs = tmp_path_factory.mktemp("runs")
    chosen = read_experiment("move", SHORT)
    folder = experiment.run(chosen, "virtual", runs, lambda *_: None, lambda *_: None).folder
    whole = folder / LOG
    cut = runs / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: -whole.stat().st_size // 3])
    recovered, old_recovered = runs / "recovered.mcap", runs / "old.mcap"
    recover(cut, recovered)
    recover(OLD_LOG, old_recovered)
    return {"whole": whole, "recovered": recovered, "old recovered": old_recovered}


def renamed(topic):
    """Present name of a topic of version 1; the file itself keeps the old one."""
    head, _, channel = topic.rpartition("/")
    return f"{head}/{RENAMED.get(channel, channel)}"


@pytest.mark.parametrize("kind", ["whole", "recovered", "old recovered"])
def test_a_log_of_every_kind_opens_in_every_reader(reader, logs, kind):
    path = logs[kind]
    ours = read_log(path)
    found = reader(path)
    counts = found["counts"]
    if kind == "old recovered":
        counts = {renamed(topic): count for topic, count in counts.items()}
    assert counts == {topic: len(entries) for topic, entries in ours.topics.items()}
    assert found["ordered"]
    assert sorted(found["attachments"]) == sorted(ours.attachments)
    assert {"foxglove.CompressedImage", "swayless.AngleSample"} <= set(found["schemas"])


def test_the_pictures_of_a_log_are_jpeg_files(logs):
    pictures = [json.loads(entry.data) for entry in read_log(logs["whole"]).topics["/camera/image"]]
    assert len(pictures) >= 5
    assert all(base64.b64decode(p["data"]).startswith(b"\xff\xd8\xff") for p in pictures)
    assert {p["format"] for p in pictures} == {"jpeg"}


def test_what_is_recovered_of_damaged_copies_opens_in_every_reader(reader, tmp_path):
    whole = OLD_LOG.read_bytes()
    rng = random.Random(7)
    for k in range(4):
        data = bytearray(whole)
        if k % 2:
            del data[rng.randrange(len(data) // 4, len(data)) :]
        else:
            for _ in range(5):
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        broken, mended = tmp_path / "broken.mcap", tmp_path / "mended.mcap"
        broken.write_bytes(data)
        found = recover(broken, mended)
        assert sum(reader(mended)["counts"].values()) == found.messages > 0


def test_forty_damaged_copies_are_recovered_without_a_crash(tmp_path):
    whole = OLD_LOG.read_bytes()
    rng = random.Random(11)
    messages = []
    for k in range(40):
        data = bytearray(whole)
        if k % 2:
            del data[rng.randrange(len(data)) :]
        else:
            for _ in range(rng.choice((1, 1, 4, 20))):
                data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        (tmp_path / "broken.mcap").write_bytes(data)
        with suppress(LogError):  # refused by name where not one record is left
            messages.append(recover(tmp_path / "broken.mcap", tmp_path / "mended.mcap").messages)
    assert len(messages) > 37
    assert sum(count > 1000 for count in messages) > 24


def test_an_intact_log_is_recovered_whole(tmp_path):
    found = recover(OLD_LOG, tmp_path / "mended.mcap")
    assert found.is_whole
    assert found.messages == sum(map(len, read_log(OLD_LOG).topics.values()))


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"hello " * 1000])
def test_a_file_without_a_record_is_refused_by_name(tmp_path, content):
    (tmp_path / "broken.mcap").write_bytes(content)
    with pytest.raises(LogError, match="no intact record of an MCAP file"):
        recover(tmp_path / "broken.mcap", tmp_path / "mended.mcap")
    assert not (tmp_path / "mended.mcap").exists()


def test_a_log_is_not_recovered_onto_itself(tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(OLD_LOG.read_bytes())
    with pytest.raises(LogError, match="is the damaged file itself"):
        recover(path, path)
    assert path.read_bytes() == OLD_LOG.read_bytes()
