"""Reports in a browser: they open from disk without a request or a message, play, sort, copy, and are accessible."""

from __future__ import annotations

import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import REFERENCE, ParameterPlan, paper_study, reduced, write_parameter_study

import femimpact as fi

CHROMIUM, DRIVER = (shutil.which(name) for name in ("chromium", "chromedriver"))

if CHROMIUM is None or DRIVER is None:
    pytest.skip("no Chromium with its driver here (Debian: chromium, chromium-driver)", allow_module_level=True)
webdriver = pytest.importorskip("selenium.webdriver", reason="no selenium here: pip install -e '.[browser]'")

pytestmark = [pytest.mark.impacts, pytest.mark.filterwarnings("ignore::ResourceWarning")]

AXE = Path(os.environ.get("FEMIMPACT_AXE", ""))
"""axe.min.js, where `.ci/browser` has fetched it."""

SCHEMES = ("light", "dark")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A report with everything: a player with a ball, a stop, curves, maps, tables, texts with markup."""
    import xarray

    law = fi.Rigid(0.7)
    structure = replace(
        REFERENCE, impactors=(replace(REFERENCE.impactors[0], contact=law),), stops=(fi.Stop("pad", 0.2, 3e-3, law),)
    )
    system = reduced(structure, 4, 10)
    record = fi.Recorder(snapshots=1, snapshots_start=3.0)
    run = fi.integrate(system, fi.Sine(0.3e-3, 5.0), fi.EventDriven(), 4.0, record)
    curve = fi.frequency_sweep(system, 0.2e-3, np.linspace(4.8, 5.2, 9), fi.EventDriven(), cycles=30)
    maps = xarray.Dataset({"peak": (("gap", "e"), np.random.default_rng(0).random((5, 6)))})
    parts = {
        "Run <b>": run,
        "Curve": curve,
        "Map": maps,
        "Table": {"x": [2.5, -1.0, 10.0], "word": ['a,"b"', "c", "<i>"]},
    }
    path = tmp_path_factory.mktemp("browser") / "report.html"
    return fi.report(path, parts, structure, title="A <script>alert(1)</script>", notes=("</style><img src=x>",))


@pytest.fixture(scope="module")
def study_page(tmp_path_factory):
    """The report of a parameter study over three axes: maps with hatching or dots, and a row for each case."""
    paper = paper_study()
    ball = replace(paper.structure.impactors[0], contact=fi.Rigid(0.6))
    axes = {
        "impactor.ball.gap": [1e-3, 2e-3, 4e-3],
        "impactor.ball.contact.restitution": [0.5, 0.7],
        "base.start": ["base", "space"],
    }
    given = replace(
        paper, structure=replace(paper.structure, impactors=(ball,)), mesh=replace(paper.mesh, elements=6),
        reduction=replace(paper.reduction, modes=2), method={"name": "event-driven"}, text="",
        output=replace(paper.output, figures=False), plan=ParameterPlan(("peak", "regime"), axes, cycles=9),
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("browser_study") / "out"
    write_parameter_study(given, folder)
    return folder / "report.html"


@pytest.fixture(scope="module")
def browser():
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    # as root no sandbox can be made
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1200,900"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options, webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


def opened(browser, page, scheme="light", motion="reduce", width=1200, media=""):
    """Open a page and return its address."""
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    features = [
        {"name": "prefers-color-scheme", "value": scheme}, {"name": "prefers-reduced-motion", "value": motion},
    ]  # fmt: skip
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": media, "features": features})
    browser.get("about:blank")
    for kind in ("browser", "performance"):
        browser.get_log(kind)
    browser.get(page.as_uri())
    return page.as_uri()


def find(browser, selector):
    return browser.find_element("css selector", selector)


def time_of(browser):
    """Time (s) that the player shows."""
    return float(find(browser, ".player output").text.split()[2])


def waited(browser, condition):
    from selenium.webdriver.support.ui import WebDriverWait

    return WebDriverWait(browser, 20, poll_frequency=0.05).until(lambda _: condition())


@pytest.mark.parametrize("scheme", SCHEMES)
def test_it_opens_from_disk_without_a_request_and_without_a_message(browser, page, scheme):
    address = opened(browser, page, scheme)
    waited(browser, lambda: find(browser, ".player output").text)
    assert browser.get_log("browser") == []
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = {event["params"]["request"]["url"] for event in events if event["method"] == "Network.requestWillBeSent"}
    # an image in the page itself is no request
    assert {url for url in asked if not url.startswith("data:")} == {address}
    assert browser.title == "A <script>alert(1)</script>"
    assert browser.find_elements("css selector", "img, b i, .notes img") == []


@pytest.mark.parametrize("width", [320, 400, 768, 1200])
@pytest.mark.parametrize("which", ["page", "study_page"])
def test_nothing_is_wider_than_the_screen(browser, request, which, width):
    opened(browser, request.getfixturevalue(which), width=width)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width


def test_the_player_advances_and_pauses(browser, page):
    opened(browser, page)
    play = find(browser, "[data-do=play]")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", play)
    begin = time_of(browser)
    play.click()
    assert play.text == "Pause"
    waited(browser, lambda: time_of(browser) > begin + 0.01)
    play.click()
    assert play.text == "Play"
    stopped = time_of(browser)
    browser.execute_async_script("setTimeout(arguments[0], 300)")
    assert time_of(browser) == stopped
    drawn = browser.execute_script(
        "const c = document.querySelector('canvas');"
        "return new Set(c.getContext('2d').getImageData(0, 0, c.width, c.height).data).size"
    )
    assert drawn > 10


def test_it_begins_by_itself_only_where_motion_is_wanted(browser, page):
    for motion, plays in (("reduce", False), ("no-preference", True)):
        opened(browser, page, motion=motion)
        begin = time_of(browser)
        browser.execute_script("document.querySelector('.stage').scrollIntoView({block: 'center'})")
        if plays:
            waited(browser, lambda begin=begin: time_of(browser) > begin)
        else:
            browser.execute_async_script("setTimeout(arguments[0], 500)")
            assert time_of(browser) == begin


def test_keys_step_and_go_from_impact_to_impact(browser, page):
    from selenium.webdriver.common.keys import Keys

    opened(browser, page)
    player = find(browser, ".player")
    data = json.loads(find(browser, ".player script").get_attribute("textContent"))
    times = data["time"]
    impacts = sorted({one[0] for one in data["impacts"]} - {0})
    assert len(impacts) > 2
    # of the player, and of the page while the player is in view
    for element in (player, find(browser, "body")):
        find(browser, ".player input[type=range]").send_keys(Keys.HOME)
        browser.execute_script("document.activeElement.blur(); arguments[0].scrollIntoView({block: 'center'})", player)
        assert time_of(browser) == pytest.approx(times[0], abs=6e-5)
        element.send_keys(Keys.ARROW_RIGHT)
        assert time_of(browser) == pytest.approx(times[1], abs=6e-5)
        element.send_keys(Keys.ARROW_LEFT)
        for frame in [one for one in impacts if one > 0][:3]:
            element.send_keys(Keys.SHIFT, Keys.ARROW_RIGHT)
            assert time_of(browser) == pytest.approx(times[frame], abs=6e-5)
        element.send_keys(Keys.SHIFT, Keys.ARROW_LEFT)
        assert time_of(browser) == pytest.approx(times[impacts[1]], abs=6e-5)
        for words in ("Pause", "Play"):
            element.send_keys(Keys.SPACE)
            assert find(browser, "[data-do=play]").text == words
    # out of view the page scrolls
    begin = time_of(browser)
    browser.execute_script("window.scrollTo(0, document.body.scrollHeight)")
    browser.execute_async_script("setTimeout(arguments[0], 300)")
    find(browser, "body").send_keys(Keys.ARROW_RIGHT)
    assert time_of(browser) == begin


def test_a_table_sorts_by_numbers_and_is_copied_with_all_digits(browser, page):
    opened(browser, page)
    holder = browser.find_elements("css selector", "div.table")[-1]
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", holder)

    def column():
        return [cell.text.replace("\u2212", "-") for cell in holder.find_elements("css selector", "td.number")]

    button = holder.find_element("css selector", "th button")
    button.click()
    assert [float(text) for text in column()] == [-1.0, 2.5, 10.0]
    button.click()
    assert [float(text) for text in column()] == [10.0, 2.5, -1.0]
    browser.execute_cdp_cmd(
        "Browser.grantPermissions", {"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]}
    )
    holder.find_element("css selector", ".below button").click()
    waited(browser, lambda: holder.find_element("css selector", "[role=status]").text == "copied")
    copied = browser.execute_async_script("navigator.clipboard.readText().then(arguments[0])")
    assert copied == 'x,word\n10.0,<i>\n2.5,"a,""b"""\n-1.0,c\n'


def test_it_prints_with_every_row_and_without_controls(browser, page):
    opened(browser, page, media="print")
    assert not find(browser, ".player .controls").is_displayed()
    assert not find(browser, "nav").is_displayed()
    hidden = browser.execute_script(
        "return [...document.querySelectorAll('.scroll')].filter(e => e.scrollHeight > e.clientHeight + 2).length"
    )
    assert hidden == 0
    assert len(browser.execute_cdp_cmd("Page.printToPDF", {})["data"]) > 1000


@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not here: .ci/browser fetches it")
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", [400, 1200])
@pytest.mark.parametrize("which", ["page", "study_page"])
def test_axe_finds_nothing_serious(browser, request, which, scheme, width):
    opened(browser, request.getfixturevalue(which), scheme, width=width)
    browser.execute_script(AXE.read_text(encoding="utf-8"))
    found = browser.execute_async_script("axe.run().then(arguments[0])")
    serious = [
        (one["id"], one["nodes"][0]["html"][:200], one["nodes"][0]["failureSummary"][:300])
        for one in found["violations"]
        if one["impact"] in ("serious", "critical")
    ]
    assert serious == []
    assert len(found["passes"]) > 10
