"""The page in headless Chromium, opened from disk: tables sort, charts are drawn, views turn, the console is silent."""

import importlib.util
import json
import os
import shutil

import pytest

from regbench.report.page import report_page
from tests.report.helpers import method, motion, protocol, row, write_run

EVIL = "</script><script>document.title='taken'</script><img src=x onerror=\"document.title='taken'\">"
PROBLEMS = 8


@pytest.fixture(scope="module")
def browser():
    """A browser that keeps its console; where none is installed the tests are skipped, but never in CI."""
    missing = [name for name in ("chromium", "chromedriver") if not shutil.which(name)]
    missing += ["selenium (pip)"] if importlib.util.find_spec("selenium") is None else []
    if missing:
        message = f"no browser to look with: {', '.join(missing)} missing (apt-get install chromium chromium-driver)"
        if os.environ.get("CI") == "true":
            pytest.fail(message)
        pytest.skip(message)
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    # Root has no sandbox, containers a small /dev/shm.
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1280,1600"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    """A page of two methods on demo@1, one of them named and failing as an attacker would."""
    from regbench.protocols.demo import DEMO

    folder = tmp_path_factory.mktemp("page")
    problems = DEMO.open(folder)
    pairs = [problems.pair(i) for i in range(PROBLEMS)]
    good, evil = method("good"), method(f"evil[{EVIL}]")
    p = protocol("demo@1", [pair.T_target_source for pair in pairs])
    rows = []
    for i, pair in enumerate(pairs):
        rows.append(row(good, p, i, pair.T_target_source @ motion((i / 2, 0, 0)), time_ms=1.0 + i))
        if i % 2:
            rows.append(row(evil, p, i, status="error", error=EVIL))
        else:
            rows.append(row(evil, p, i, pair.T_target_source @ motion((10 * i, 0, 0), (0.1, 0, 0)), time_ms=10.0))
    run = write_run(folder / "run", [good, evil], [p], rows, cpu=EVIL)
    lines = [json.loads(line) for line in (run / "problems.jsonl").read_text().splitlines()]
    named = [line | {"label": pair.label, "id": EVIL} for line, pair in zip(lines, pairs, strict=True)]
    (run / "problems.jsonl").write_text("".join(json.dumps(line) + "\n" for line in named))
    page, left_out = report_page([run])
    assert left_out == []
    (folder / "report.html").write_text(page)
    return folder / "report.html"


@pytest.fixture
def opened(browser, page_file):
    """The page, freshly opened; at the end its console must hold nothing."""
    browser.get(page_file.as_uri())
    yield browser
    assert browser.get_log("browser") == []


def all_of(driver, selector, within=None):
    return (within or driver).find_elements("css selector", selector)


def one_of(driver, selector, within=None):
    return (within or driver).find_element("css selector", selector)


def test_nothing_from_outside_runs_and_nothing_is_asked_of_the_network(opened):
    assert opened.title == "regbench: demo@1"
    assert all_of(opened, "img") == []
    assert len(all_of(opened, "script")) == 2
    assert opened.execute_script("return performance.getEntriesByType('resource').length") == 0
    assert EVIL in one_of(opened, "main").text  # seen as what it is


def test_a_click_on_a_head_sorts_and_another_turns_the_order(opened):
    table = one_of(opened, "table.figures")
    names = [head.text.split("\n")[0] for head in all_of(opened, "thead th", table)]
    button = all_of(opened, "thead button", table)[names.index("RRE mean")]
    for order, first in (("ascending", "good"), ("descending", f"evil[{EVIL}]")):
        button.click()
        assert all_of(opened, "thead th", table)[names.index("RRE mean")].get_attribute("aria-sort") == order
        assert one_of(opened, "tbody th", table).text == first
        assert len(all_of(opened, "tbody tr", table)) == 2


def test_a_table_sorts_with_the_keyboard_and_text_as_text(opened):
    from selenium.webdriver.common.keys import Keys

    table = one_of(opened, "table.shares")
    before = [cell.text for cell in all_of(opened, "tbody th", table)]
    button = all_of(opened, "thead button", table)[0]
    button.send_keys(Keys.ENTER)
    button.send_keys(Keys.ENTER)
    assert [cell.text for cell in all_of(opened, "tbody th", table)] == sorted(before, reverse=True)


def test_charts_are_drawn_told_in_words_and_methods_can_be_hidden(opened):
    charts = all_of(opened, ".charts svg[role=img]")
    assert len(charts) == 7
    assert all(len(chart.get_attribute("aria-label")) > 40 for chart in charts)
    assert "NaN" not in one_of(opened, ".charts").get_attribute("innerHTML")
    curves = "return document.querySelector('.charts svg[role=img]').querySelectorAll('path[stroke-width]').length"
    assert opened.execute_script(curves) == 2
    one_of(opened, ".legend button").click()
    assert opened.execute_script(curves) == 1
    assert one_of(opened, ".legend button").get_attribute("aria-pressed") == "false"


def picture(driver, name):
    return driver.execute_script(f"return document.querySelector('canvas[data-view={name}]').toDataURL()")


def settled(driver):
    """Return once the page has drawn what was asked for."""
    driver.execute_async_script("const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(done))")


def test_both_views_turn_with_the_mouse_and_the_keyboard_and_turn_back(opened):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    settled(opened)
    start = [picture(opened, name) for name in ("before", "after")]
    assert len(set(start)) == 2
    canvas = one_of(opened, "canvas[data-view=after]")
    opened.execute_script("arguments[0].scrollIntoView({block: 'center'})", canvas)
    ActionChains(opened).move_to_element(canvas).click_and_hold().move_by_offset(80, 30).release().perform()
    settled(opened)
    turned = [picture(opened, name) for name in ("before", "after")]
    assert all(a != b for a, b in zip(start, turned, strict=True))
    canvas.send_keys(Keys.ARROW_LEFT, "+")
    settled(opened)
    assert picture(opened, "after") not in (start[1], turned[1])
    canvas.send_keys("0")
    settled(opened)
    assert [picture(opened, name) for name in ("before", "after")] == start


def test_another_pair_another_method_and_colour_by_distance_change_the_picture(opened):
    settled(opened)
    first = picture(opened, "after")
    buttons = all_of(opened, ".views [role=group] button")
    assert [button.text for button in buttons] == ["worst 1", "worst 2", "worst 3", "median", "best"]
    buttons[-1].click()
    settled(opened)
    best = picture(opened, "after")
    one_of(opened, ".views input[type=checkbox]").click()
    settled(opened)
    by_distance = picture(opened, "after")
    opened.execute_script(
        "const s = document.querySelector('.views select'); s.selectedIndex = 1; s.dispatchEvent(new Event('change'))"
    )
    settled(opened)
    assert len({first, best, by_distance, picture(opened, "after")}) == 4
    assert "evil[" in one_of(opened, ".views [aria-live]").text


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_from_the_ground_in_light_and_dark(opened, scheme):
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
    settled(opened)
    for selector in ("body", "caption", ".note", ".failed", "a"):
        ratio = contrast(
            *opened.execute_script(
                f"return [getComputedStyle(document.querySelector('{selector}')).color, "
                "getComputedStyle(document.body).backgroundColor]"
            )
        )
        assert ratio >= 4.5, f"{selector} in {scheme}"  # WCAG 2.1, level AA


def contrast(first, second):
    """Return the contrast ratio of two CSS colours (WCAG 2.1)."""

    def luminance(colour):
        values = [int(part) / 255 for part in colour.split("(")[1].rstrip(")").split(",")[:3]]
        red, green, blue = (v / 12.92 if v <= 0.03928 else ((v + 0.055) / 1.055) ** 2.4 for v in values)
        return 0.2126 * red + 0.7152 * green + 0.0722 * blue

    darker, lighter = sorted(map(luminance, (first, second)))
    return (lighter + 0.05) / (darker + 0.05)


def test_the_page_fits_a_narrow_window(opened):
    size = opened.get_window_size()
    try:
        opened.set_window_size(500, 900)
        settled(opened)
        assert opened.execute_script("return document.documentElement.scrollWidth <= window.innerWidth")
    finally:
        opened.set_window_size(size["width"], size["height"])
