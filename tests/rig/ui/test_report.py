"""The report: it tells the story of a run, stands alone, and takes no text of a log as markup."""

import base64
import json
import math
import re
import tomllib
from html.parser import HTMLParser
from pathlib import Path

import pytest

from comms.link import LinkCount
from comms.mcap_log import LogWriter
from comms.messages import AngleSample, Command, InvalidReason, LinkAngle, SwingPlane, Verb
from comms.records import CompressedImage, Event, LinkRow, Stamp
from rig.analysis.analyze import RunAnalysis
from rig.analysis.conclusion import conclude
from rig.run.config import read_experiment
from rig.run.experiment import run
from rig.ui.plots.style import DARK
from rig.ui.report import write
from rig.ui.report_page import element, link, table

OLD_LOG = Path(__file__).parents[2] / "data" / "logs" / "e295f92_move_virtual.mcap"
MARKUP = "<script>alert(1)</script><img src=x onerror='alert(2)'>\"'&amp;\x1b[2J"
SHOWN = MARKUP.replace("\x1b", "")  # as the reader sees it
VOID = ("meta", "img")
TRACKER = {  # vision.json
    "average_frames": 3,
    "period_ns": 20_000_000,
    "pivot_home_px": [320.0, -58.0],
    "pixels_per_m": 1005.0,
}
ANGLE = AngleSample(
    seq=1,
    t_ns=0,
    t_valid_ns=0,
    swing_plane=SwingPlane.X,
    valid=True,
    reason=InvalidReason.NONE,
    platform_m=0.0,
    rows=400,
    residual_px=0.1,
    pivot_miss_px=0.0,
    background=200.0,
    saturation=0.0,
    links=(LinkAngle(angle_rad=0.01, sigma_rad=1e-5, raw_rad=0.01, offset_rad=0.0, joint_px=None),),
)
COMMAND = "rig run move --clock virtual"


class Page(HTMLParser):
    """Elements of a page; a page whose elements do not nest is refused."""

    def __init__(self, text):
        super().__init__()
        self.open = []  # names of the elements around the present place
        self.attributes = []  # (element, name, value)
        self.tags = set()
        self.texts = []  # (elements around it, text)
        self.rows = []  # of all tables: texts of the cells
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        self.attributes += [(tag, name, value) for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("th", "td"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append((tuple(self.open), data))
        if {"th", "td"} & set(self.open):
            self.rows[-1][-1] += data

    def inside(self, tag):
        """Texts inside the elements of a name."""
        return [text for around, text in self.texts if tag in around]

    def row(self, head):
        """Cells beside a heading."""
        (cells,) = (row[1:] for row in self.rows if row and row[0] == head)
        return cells


def report_of(folder, log=None, twin=None):
    """Report of a log, as text and as a page."""
    analysis = RunAnalysis(log or folder / "run.mcap")
    other = RunAnalysis(twin / "run.mcap") if twin else None
    text = write(folder, analysis, other).read_text(encoding="utf-8")
    return text, Page(text)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A run in which references are lost, with its twin."""
    changes = ["links.reference.loss=0.2", "links.reference.burst=3", "experiment.watch_s=6"]
    changes += ["safety.reference_stale_ms=1000", "limits.speed_m_s=0.75"]
    return run(
        read_experiment("move", changes),
        "virtual",
        tmp_path_factory.mktemp("runs"),
        lambda *_: None,
        lambda *_: None,
        command=COMMAND,
    )


@pytest.fixture(scope="module")
def told(finished):
    """Its report."""
    return report_of(finished.folder, twin=finished.twin)


def experiment_json(**tables):
    """experiment.json with the few keys that the analysis needs, and more tables."""
    needed = {
        "camera": {"rate_hz": 50.0},
        "vision": {"average_frames": 3},
        "model": {"gravity_m_s2": 9.81, "length_m": 1.0},
    }
    return json.dumps(needed | tables).encode()


def write_log(
    path, *, start, stop, experiment, text="armed", links=("reference",), image=None, tracker=None
):
    """A log without angles, or with one angle and one picture."""
    log = LogWriter(path, {"run_id": "r", "mode": "virtual", "experiment": "e"} | start, 0)
    plan = {"planner": text, "distance_m": 0.2, "time_s": 1.5, "quiet_s": 1.0, "watch_s": 2.0}
    plan |= {"positions_m": [[0.0, 0.0, 0.0]] * 3, "metrics": None}
    log.attach("experiment.json", "application/json", experiment)
    log.attach("plan.json", "application/json", json.dumps(plan).encode())
    order = Command(seq=1, t_ns=0, id=1, to="streamer", verb=Verb.START, t_start_ns=5)
    log.write("/command", order, 0, 0)
    log.write("/events", Event(t_ns=1, level=text, source=text, text=text), 1, 1)
    for k, name in enumerate(links):
        row = LinkRow(channel=name, count=LinkCount(sent=k, rejected={text: k}))
        log.write(f"/link/{name}", row, 2, 2)
    if image is not None:
        log.attach("vision.json", "application/json", json.dumps(tracker).encode())
        log.write("/angle_1", ANGLE, 3, 3)
        picture = CompressedImage(
            timestamp=Stamp(sec=1, nsec=0), frame_id=text, data=image, format=text
        )
        log.write("/camera/image", picture, 3, 3)
    log.close({"exit_status": "ok", "exit_code": "0"} | stop)


def test_a_report_begins_with_the_conclusion_and_what_follows_from_it(finished, told):
    _, page = told
    analysis = RunAnalysis(finished.folder / "run.mcap")
    conclusion = conclude(analysis.run, analysis.summary)
    assert page.inside("h1") == [conclusion.sentence]
    assert "good" in page.inside("b")
    setting, command, repeat, _events = page.inside("pre")
    assert tomllib.loads(setting) == {"model": {"length_m": 0.98}}
    assert command == f"{COMMAND} --set model.length_m=0.980"
    assert repeat == COMMAND


def test_a_report_lays_the_model_beside_planned_measured_and_true_values(told):
    _, page = told
    model, planned, measured, true = page.row("cable length, m")
    assert (model, planned, true) == ("1.0000", "", "0.9800")
    assert float(measured.split(" ± ")[0]) == pytest.approx(0.98, abs=1e-4)
    model, planned, _, true = page.row("natural frequency, Hz")
    assert (model, planned) == (f"{math.sqrt(9.81) / (2 * math.pi):.5f}", "")
    assert true == f"{math.sqrt(9.81 / 0.98) / (2 * math.pi):.5f}"
    assert page.row("damping ratio")[0] == "0.000000"


def test_a_report_lays_the_true_swing_without_losses_beside_it(finished, told):
    _, page = told
    twin = RunAnalysis(finished.twin / "run.mcap").summary.truth
    head = page.rows.index(["true swing", "this run", "without losses"])
    assert page.rows[head + 2][2] == f"{twin.residual_swing_rad * 1e3:.3f}"


def test_a_report_names_the_parameters_of_the_run(finished, told):
    _, page = told
    run_log = RunAnalysis(finished.folder / "run.mcap").run
    start = run_log.log.metadata["run.start"]
    assert page.row("seed") == ["1"]
    assert page.row("links") == ["frame_1 (8 ms), reference (1 ms, 20% lost in bursts of 3)"]
    assert page.row("limits")[0].startswith("speed 0.75 m/s (plan 0.281), acceleration 5 m/s²")
    assert page.row("duration")[0].startswith("11 s: quiet 3.5, move 1.5, watching 6")
    assert page.row("planner") == ["matrix_exponential: 0.2 m in 1.5 s, acceleration input"]
    assert page.row("digest") == [run_log.log.metadata["run.stop"]["digest"]]
    assert page.row("code") == [start["code"]]
    assert page.row("log") == ["run.mcap"]
    assert ("a", "href", "./run.mcap") in page.attributes
    assert start["versions"].split()[1].replace("=", " ") in page.row("versions")[0]


def test_a_report_stands_alone_and_runs_nothing(told):
    text, page = told
    assert "http" not in text
    assert not page.tags & {"script", "link", "iframe", "object", "embed", "form"}
    for _, name, value in page.attributes:
        assert not name.startswith("on")
        if name in ("src", "href", "xlink:href"):
            assert value.startswith(("./run.mcap", "#", "data:image/jpeg;base64,"))


def test_a_report_has_the_viewport_of_the_screen_and_a_dark_theme(told):
    text, page = told
    assert ("meta", "name", "viewport") in page.attributes
    assert "prefers-color-scheme: dark" in text
    drawings = text.split("</style>")[1]
    for light in DARK:
        assert light not in drawings


def test_figures_hold_their_words_as_text(told):
    _, page = told
    words = page.inside("text")
    for title in ("position x [m]", "swing [mrad]", "swing after the move [mrad]"):
        assert title in words
    assert words.count("measured - true [mrad]") == 2  # below the swing and the residual swing


def test_identifiers_of_the_figures_are_distinct(told):
    text, _ = told
    clips = re.findall(r'<clipPath id="([^"]+)"', text)
    assert len(clips) == len(set(clips)) == 6  # two panels in each of three figures


def test_a_report_written_again_is_the_same(finished, told):
    again, _ = report_of(finished.folder, twin=finished.twin)
    assert again == told[0]


def test_a_log_full_of_markup_gives_a_harmless_report(tmp_path):
    start = dict.fromkeys(
        ("run_id", "mode", "experiment", "command", "seed", "calibration", "code", "utc"), MARKUP
    )
    start |= {"versions": MARKUP, "python": MARKUP, "kind": MARKUP, "git_commit": MARKUP}
    stop = {"exit_status": MARKUP, "digest": MARKUP, "reasons": MARKUP}
    faults = {"delay_ms": 8.0, "burst": MARKUP}
    tables = {"links": {MARKUP: faults}, "plan": {"input": MARKUP, "robust": [MARKUP]}}
    tables |= {"experiment": {"purpose": MARKUP}, "limits": {"speed_m_s": MARKUP}}
    path = tmp_path / "run.mcap"
    write_log(
        path,
        start=start,
        stop=stop,
        experiment=experiment_json(**tables),
        text=MARKUP,
        links=(MARKUP, "reference"),
        image=b"no image " + MARKUP.encode(),
        tracker=TRACKER,
    )
    text, page = report_of(tmp_path)
    assert "<script" not in text
    assert not page.tags & {"script", "img"}
    assert not [name for _, name, _ in page.attributes if name.startswith("on")]
    assert "\x1b" not in text
    whole = "".join(page.inside("main"))
    assert page.row("digest") == page.row("seed") == [SHOWN]
    assert page.row(SHOWN)[0] == "0"  # the link of that name, none sent
    assert f"({SHOWN})" in whole  # exit status
    assert f"· {SHOWN} · {SHOWN}" in whole  # run id and mode


def test_words_in_place_of_numbers_in_the_metadata_are_bad_data(tmp_path):
    stop = {"exit_code": MARKUP, "loop_s": MARKUP, "cpu_share": f"vision=0.5 bench={MARKUP}"}
    write_log(tmp_path / "run.mcap", start={}, stop=stop, experiment=experiment_json())
    summary = RunAnalysis(tmp_path / "run.mcap").summary
    assert (summary.exit_code, summary.loop_s, summary.cpu_share) == (6, None, {"vision": 0.5})


def test_a_log_without_the_optional_keys_has_a_report(tmp_path):
    write_log(tmp_path / "run.mcap", start={}, stop={}, experiment=experiment_json())
    _, page = report_of(tmp_path)
    for name in ("seed", "limits", "links", "calibration", "versions", "started"):
        assert page.row(name) == ["not recorded"]
    assert page.inside("pre")[0] == "rig run e"


def test_the_model_of_a_chain_has_no_length_of_a_cable(tmp_path):
    chain = {"gravity_m_s2": 9.81, "length_m": None, "links": ["0.5:1:bar", "0.4:2:point"]}
    experiment = experiment_json(model=chain)
    write_log(tmp_path / "run.mcap", start={}, stop={}, experiment=experiment)
    _, page = report_of(tmp_path)
    assert page.row("cable length, m")[0] == ""
    assert "0.4:2:point" in page.row("model")[0]


def test_a_log_of_an_old_build_has_a_report(tmp_path):
    _, page = report_of(tmp_path, OLD_LOG)
    assert page.inside("h1")[0].startswith("The load keeps 2.7 mrad")
    assert ("a", "href", f"./{OLD_LOG.name}") in page.attributes


@pytest.mark.parametrize("image", [b"", b"no image", b"\xff\xd8\xff<script>"])
@pytest.mark.parametrize("settings", [TRACKER, {}, {"pivot_home_px": MARKUP}])
def test_a_picture_that_is_none_is_left_out(tmp_path, image, settings):
    path = tmp_path / "run.mcap"
    experiment = experiment_json()
    write_log(path, start={}, stop={}, experiment=experiment, image=image, tracker=settings)
    _, page = report_of(tmp_path)
    assert "image" not in page.tags


def test_the_camera_image_is_encoded_anew(told):
    _, page = told
    (url,) = (value for tag, name, value in page.attributes if (tag, name) == ("image", "href"))
    data = base64.b64decode(url.removeprefix("data:image/jpeg;base64,"))
    assert data.startswith(b"\xff\xd8\xff")


def test_contents_and_attributes_of_an_element_are_escaped():
    made = element("p", "a < b & c", element("b", 3), class_='x" onclick="y', aria_label="'")
    assert made.markup == (
        '<p class="x&quot; onclick=&quot;y" aria-label="&#x27;">a &lt; b &amp; c<b>3</b></p>'
    )


def test_the_cells_of_a_table_are_escaped():
    made = table(["<i>"], [["<b>", "<u>"]]).markup
    assert not {"i", "b", "u"} & Page(made).tags


@pytest.mark.parametrize("name", ["javascript:alert(1).mcap", '"><script>.mcap', "a b#?%.mcap"])
def test_a_link_leads_to_a_file_of_any_name(name):
    page = Page(link(name).markup)
    ((_, _, address),) = page.attributes
    assert re.fullmatch(r"\./[A-Za-z0-9_.%~-]+", address)
    assert page.inside("a") == [name]
