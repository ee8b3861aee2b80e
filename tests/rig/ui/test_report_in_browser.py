"""The report in headless Chromium: on a phone and on a screen nothing is cut, light and dark.

Needs the Debian packages chromium and chromium-driver.
"""

import shutil

import pytest

from rig.analysis.analyze import RunAnalysis
from rig.run.config import read_experiment
from rig.run.experiment import run
from rig.run.runs import LOG
from rig.ui.report import write

CHROMIUM = shutil.which("chromium")
DRIVER = shutil.which("chromedriver")

pytestmark = [
    pytest.mark.xdist_group("browser"),
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed"),
    pytest.mark.skipif(DRIVER is None, reason="chromedriver is not installed"),
]

OPTIONS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage")
PHONE_PX = 400
SCREEN_PX = 1300
MIN_PLOT_TEXT_PX = 10.0
MIN_CONTRAST = 4.5  # WCAG 2.1, text
LONG_NAME = "a" * 60

# texts that leave the page, the box that hides what overflows, or the drawing they stand in
CUT_TEXTS = """
const cut = [];
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const node = walker.currentNode;
  if (!node.data.trim()) continue;
  const range = document.createRange();
  range.selectNodeContents(node);
  const drawing = node.parentElement.closest('svg');
  let left = 0, right = document.documentElement.clientWidth, top = -1e9, bottom = 1e9;
  for (let box = node.parentElement; box !== document.body; box = box.parentElement) {
    if (box.tagName !== 'svg' && getComputedStyle(box).overflowX === 'visible') continue;
    const edge = box.getBoundingClientRect();
    left = Math.max(left, edge.left);
    right = Math.min(right, edge.right);
    top = Math.max(top, edge.top);
    bottom = Math.min(bottom, edge.bottom);
  }
  const outside = r => r.left < left - 1 || r.right > right + 1 || r.top < top - 1
    || r.bottom > bottom + 1;
  if ([...range.getClientRects()].some(outside)) cut.push(node.data);
}
return cut;
"""
WIDTHS = "const page = document.documentElement; return [page.scrollWidth, page.clientWidth];"
PLOT_TEXT_PX = """
return [...document.querySelectorAll('svg text')].map(
  text => parseFloat(getComputedStyle(text).fontSize) * text.getScreenCTM().d);
"""
COLOURS = """
const colour = (one, key) => getComputedStyle(document.querySelector(one))[key];
return [colour('body', 'backgroundColor'), colour('body', 'color'),
  colour('figure', 'backgroundColor'), colour('svg text', 'fill'), colour('.note', 'color'),
  colour('h1', 'color')];
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """Report of a run with losses, a twin, and a name as long as names may be."""
    changes = ["links.reference.loss=0.2", "links.reference.burst=3", "experiment.watch_s=6"]
    changes += ["safety.reference_stale_ms=1000", f"experiment.name={LONG_NAME}"]
    changes += ["safety.initial_swing_rad=0.02"]
    experiment = read_experiment("move", changes)
    folder = tmp_path_factory.mktemp("runs")
    command = f"rig run move --set experiment.name={LONG_NAME}"
    finished = run(experiment, "virtual", folder, lambda *_: None, lambda *_: None, command=command)
    twin = RunAnalysis(finished.twin / LOG)
    return write(finished.folder, RunAnalysis(finished.folder / LOG), twin)


@pytest.fixture(scope="module")
def browser():
    """Headless Chromium."""
    selenium = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    options = selenium.ChromeOptions()
    options.binary_location = CHROMIUM
    for option in OPTIONS:
        options.add_argument(option)
    driver = selenium.Chrome(options=options, service=selenium.ChromeService(DRIVER))
    yield driver
    driver.quit()


def show(browser, path, width_px, theme="light"):
    """Open a page on a device of this width; a phone obeys the viewport that the page names."""
    metrics = {"width": width_px, "height": 900, "deviceScaleFactor": 1}
    metrics["mobile"] = width_px == PHONE_PX
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    features = [{"name": "prefers-color-scheme", "value": theme}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    browser.get(path.as_uri())


def luminance(colour):
    """Relative luminance of "rgb(r, g, b)" by WCAG 2.1."""
    shares = [int(word) / 255 for word in colour[colour.index("(") + 1 : -1].split(",")[:3]]
    linear = [((c + 0.055) / 1.055) ** 2.4 if c > 0.04045 else c / 12.92 for c in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    """Contrast of two colours by WCAG 2.1, from 1 to 21."""
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("width_px", [PHONE_PX, SCREEN_PX])
def test_a_page_is_no_wider_than_the_device(browser, report, width_px):
    show(browser, report, width_px)
    needed_px, given_px = browser.execute_script(WIDTHS)
    assert given_px <= width_px
    assert needed_px <= given_px


@pytest.mark.parametrize("width_px", [PHONE_PX, SCREEN_PX])
def test_no_text_is_cut(browser, report, width_px):
    show(browser, report, width_px)
    assert browser.execute_script(CUT_TEXTS) == []


@pytest.mark.parametrize("width_px", [PHONE_PX, SCREEN_PX])
def test_the_text_of_a_plot_is_readable(browser, report, width_px):
    show(browser, report, width_px)
    sizes_px = browser.execute_script(PLOT_TEXT_PX)
    assert len(sizes_px) > 50
    assert min(sizes_px) >= MIN_PLOT_TEXT_PX


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_stands_out_in_both_themes(browser, report, theme):
    show(browser, report, SCREEN_PX, theme)
    page, text, card, plot_text, note, heading = browser.execute_script(COLOURS)
    assert (luminance(page) < 0.1) == (theme == "dark")
    for colour in (text, note, heading):
        assert contrast(page, colour) >= MIN_CONTRAST
    assert contrast(card, plot_text) >= MIN_CONTRAST


def test_the_story_stands_in_the_first_screen(browser, report):
    show(browser, report, SCREEN_PX)
    lowest = browser.execute_script(
        "return Math.max(...[...document.querySelectorAll('header, .first')]"
        ".map(one => one.getBoundingClientRect().bottom))"
    )
    assert lowest <= 900


def test_a_browser_finds_no_fault(browser, report):
    show(browser, report, SCREEN_PX)
    assert browser.get_log("browser") == []
