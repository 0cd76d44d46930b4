"""The report as a browser draws it: light, dark, on a phone and in print; and what a reader can do with it."""

from __future__ import annotations

import re

import pytest

import testbed
from testbed.pages.palette import luminance
from tests.report.browser import BOXES, browser, overlaps

RUN = {
    "name": "looked_at",
    "duration": "0.6 s",
    "settle": "0.3 s",
    "turntable": {"engine": "modal"},
    "motion": [{"sine": {"frequency": f, "rate": "1 deg/s"}} for f in ("10 Hz", "40 Hz", "90 Hz")],
    "sensors": {"mhd_ars": {"preset": "sx300"}, "mems_gyro": {"preset": "adis16505_filtered"}},
    "fusion": {
        "kalman": {"belief": "identified"},
        "shakf": {},
        "arw_shakf": {},
        "a_filter_of_a_long_name": {"type": "wideband"},
    },
    "pointing": {"tracker": {"bandwidth": "10 Hz"}, "mirror": {"bandwidth": "1 kHz"}, "windows": ["10 ms"]},
    "expect": {"kalman": {"rmse_deg_s": "< 1"}},
}
MODES = {
    "light": {"viewport": {"width": 1200, "height": 900}, "color_scheme": "light"},
    "dark": {"viewport": {"width": 1200, "height": 900}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 390, "height": 844}, "color_scheme": "light", "is_mobile": True},
    # A4 less its margins: what is wider than the page is lost on paper.
    "print": {"viewport": {"width": 680, "height": 1009}, "color_scheme": "dark"},
}


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("looked_at") / "run"
    testbed.run(RUN, out=folder, outputs=("report", "netcdf"))
    return folder / "report.html"


@pytest.fixture(scope="module")
def driver():
    with browser() as started:
        yield started


@pytest.fixture(params=MODES)
def page(request, driver, report):
    context = driver.new_context(**MODES[request.param])
    shown = context.new_page()
    shown.set_default_timeout(20_000)
    shown.asked, shown.errors = [], []
    shown.on("request", lambda one: shown.asked.append(one.url))
    shown.on("pageerror", lambda one: shown.errors.append(str(one)))
    if request.param == "print":
        shown.emulate_media(media="print")
    shown.goto(report.as_uri())
    yield shown
    context.close()


@pytest.mark.slow
def test_it_is_read_without_a_network_and_nothing_lies_on_anything(page, report):
    text = page.inner_text("body")
    for words in ("Errors", "Figures", "Consistency", "How to repeat it", "a_filter_of_a_long_name"):
        assert words in text
    assert page.asked == [report.as_uri()]
    assert page.errors == []
    boxes = page.evaluate(BOXES)
    assert len(boxes) > 200
    assert {box["kind"] for box in boxes} == {"text", "label"}
    assert overlaps(boxes) == []
    # Wide tables scroll by themselves; the page does not, and on paper nothing scrolls.
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


@pytest.mark.slow
def test_text_stands_out_from_its_ground(page):
    """4.5 to 1, as WCAG 2.2 asks of small text; in print the ground is white whatever the screen is."""
    colors = page.evaluate(
        """() => ["body", "figcaption", ".note", "svg"]
            .map((name) => getComputedStyle(document.querySelector(name)).color)
            .concat(getComputedStyle(document.body).backgroundColor)"""
    )
    *inks, ground = (luminance("#" + "".join(f"{int(n):02x}" for n in re.findall(r"\d+", one)[:3])) for one in colors)
    for ink in inks:
        low, high = sorted((ink, ground))
        assert (high + 0.05) / (low + 0.05) >= 4.5
    if page.evaluate("matchMedia('print').matches"):
        assert ground == 1.0


@pytest.mark.slow
def test_a_reader_zooms_and_goes_back(driver, report):
    context = driver.new_context(viewport={"width": 1200, "height": 900})
    page = context.new_page()
    page.set_default_timeout(20_000)
    page.goto(report.as_uri())
    page.get_by_role("button", name="Errors of the filters").click()
    assert page.locator("#closer .chart").get_attribute("data-view") == "Errors of the filters"
    # A chart each; what one shows of the time all show.
    legends = page.locator("#closer .u-legend")
    assert [name in text for name, text in zip(RUN["fusion"], legends.all_inner_texts(), strict=True)] == [True] * 4
    chart = page.locator("#closer .u-over").first

    def time_at(share):
        page.mouse.move(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
        return float(re.search(r"([\d.]+) s", legends.last.inner_text())[1])

    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    assert time_at(0.9) - time_at(0.1) == pytest.approx(0.8 * 0.6, rel=0.02)
    # From half to three quarters of the width.
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + 0.5 * box["height"], steps=4)
    page.mouse.up()
    assert time_at(0.9) - time_at(0.1) == pytest.approx(0.8 * 0.6 / 4, rel=0.05)
    page.mouse.dblclick(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    assert time_at(0.9) - time_at(0.1) == pytest.approx(0.8 * 0.6, rel=0.02)
    context.close()
