"""The live page in a headless Chromium, with real clicks and keys."""

import os
import shutil

import pytest
from served_page import page as page
from served_page import runs_file

from soilml import EFFECTS, Model, Operating, Wheel, soil

pytestmark = pytest.mark.browser

#: `make test-browser` asks for the tests: what is missing is then an error and no reason to skip.
NEEDED = os.environ.get("SOILML_BROWSER") == "needed"
PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "chrome")
#: Chromium asks nobody and needs neither a screen nor a user.
ARGUMENTS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
]  # fmt: skip
READY = "html[data-ready=yes] #now div"
LONG = 240_000  # ms


def missing(text):
    if NEEDED:
        pytest.fail(text)
    pytest.skip(f"{text}; `make test-browser` runs these tests")


@pytest.fixture(scope="module")
def chromium():
    """A browser."""
    program = os.environ.get("SOILML_CHROMIUM") or next(
        (found for name in PROGRAMS if (found := shutil.which(name))), None
    )
    if program is None:
        missing("no Chromium is found: apt install chromium, or set SOILML_CHROMIUM")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing("playwright is missing: pip install '.[browser]'")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture
def tab(chromium, page):
    """The page in a fresh profile; no console message, error or request to elsewhere is allowed."""
    context = chromium.new_context(viewport={"width": 1280, "height": 900}, accept_downloads=True)
    context.set_default_timeout(LONG)
    opened = context.new_page()
    said, asked = [], []
    opened.on("console", lambda message: said.append(message.text))
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.on("request", lambda sent: asked.append(sent.url))
    opened.goto(page.address)
    opened.wait_for_selector(READY)
    yield opened
    assert [text for text in said if not text.startswith(EXPECTED)] == []
    assert all(url.startswith((page.address, "blob:", "data:")) for url in asked)
    context.close()


#: Chromium itself reports an answer with an error status, which the page shows in words.
EXPECTED = "Failed to load resource: the server responded with a status of 422"


def until(tab, expression):
    """Wait for an expression; `wait_for_function` would need what the page's policy forbids."""
    for _ in range(LONG // 50):
        if tab.evaluate(expression):
            return
        tab.wait_for_timeout(50)
    raise AssertionError(f"never true: {expression}")


def number(tab, path):
    return tab.locator(f"#s-{path}")


def now(tab):
    """The values of the present point by name."""
    cells = tab.locator("#now div").all_inner_texts()
    pairs = (cell.split("\n") for cell in cells)
    return {name: float(v.split("\u00a0")[0].replace("\u2212", "-")) for name, v in pairs}


def confirm_the_wheel(tab):
    """Answer the question which wheel drove the table."""
    tab.wait_for_selector("#ask-wheel:not([hidden])", timeout=LONG)
    assert tab.locator(".band").count() == 0 and tab.locator("#gap-start").is_disabled()
    tab.get_by_role("button", name="These are right: estimate").click()


def test_sliders_keys_and_typed_values_move_the_curves(tab):
    first = now(tab)
    expected = Model(Wheel(radius=0.15, width=0.12))(
        soil("wong1989/dry_sand"), Operating(slip=0.3, load=60.0)
    )
    assert first["Torque"] == pytest.approx(float(expected.torque), rel=5e-3)
    number(tab, "shear_modulus").fill("10")
    until(tab, f"!document.querySelector('#now dd').innerText.startsWith('{first['Torque']}')")
    assert now(tab)["Torque"] > first["Torque"]
    slider = tab.get_by_label("Slip, slider", exact=True)
    slider.focus()
    before = number(tab, "slip").input_value()
    for _ in range(20):
        tab.keyboard.press("ArrowRight")
    assert float(number(tab, "slip").input_value()) > float(before)
    tab.get_by_role("button", name="Hold these curves").click()
    assert "Held (dashed)" in tab.locator("#held").inner_text()
    tab.get_by_role("button", name="Reset").click()
    until(tab, f"document.querySelector('#now dd').innerText.startsWith('{first['Torque']}')")
    assert now(tab) == first


def test_a_table_leads_to_bands_and_back_to_the_sliders(tab, tmp_path):
    file = runs_file(tmp_path, Model(Wheel(radius=0.15, width=0.12)))
    tab.set_input_files("#file", file)
    confirm_the_wheel(tab)
    tab.wait_for_selector("#pull-result summary", timeout=LONG)
    assert tab.locator(".band").count() == 3
    assert tab.get_by_text("Drive next:").is_visible()
    assert tab.locator("#pull-result figure").first.is_hidden()
    tab.get_by_text("Drawbar pull and slope against slip").click()
    assert tab.locator("#pull-result figure").first.is_visible()
    assert tab.evaluate("document.querySelector('#estimate-result .bands').offsetHeight") < 300
    assert "rows 12" in tab.locator("#table-panel").inner_text()
    with tab.expect_download() as saved:
        tab.get_by_role("link", name="Save estimates").click()
    assert saved.value.suggested_filename == "identify.json"
    tab.get_by_role("button", name="Show this soil in the forward model").click()
    value = float(number(tab, "friction_angle").input_value())
    assert value == pytest.approx(28.0, abs=5.0)


def test_a_gap_is_named_and_can_be_cancelled(tab, tmp_path):
    digging = Model(Wheel(radius=0.15, width=0.12)) + EFFECTS["slip-sinkage"](n1=0.5)
    tab.set_input_files("#file", runs_file(tmp_path, digging, (40.0, 90.0)))
    confirm_the_wheel(tab)
    tab.wait_for_selector("#pull-result summary, #estimate-error:not([hidden])", timeout=LONG)
    start = tab.get_by_role("button", name="Look for a gap")
    start.click()
    tab.locator("#gap-job").get_by_role("button", name="Cancel").click()
    tab.wait_for_selector("#gap-job", state="hidden")
    until(tab, "!document.querySelector('#gap-start').disabled")
    assert tab.locator(".verdict").count() == 0
    start.click()
    tab.wait_for_selector(".verdict", timeout=LONG)
    assert "slip-sinkage" in tab.locator(".verdict").inner_text()
    assert tab.evaluate("document.querySelector('#gap').offsetHeight") < 800  # one screen
    assert tab.locator("table.map").first.is_hidden()
    tab.get_by_text("Where the model disagrees").click()
    assert tab.locator("table.map").first.is_visible() and tab.locator("table.map").count() == 2
    with tab.context.expect_page() as opened:
        tab.get_by_role("link", name="Open the full report").click()
    opened.value.wait_for_load_state()
    assert "Gap report" in opened.value.title()


def test_wheels_are_compared_for_a_slope(tab):
    tab.get_by_label("Slope (deg)").fill("8")
    tab.keyboard.press("Tab")
    text = "document.querySelector('#design-text').value"
    until(tab, f"{text}.includes('8 deg')")
    tab.get_by_label("Width (mm), from").fill("300")
    tab.keyboard.press("Tab")
    until(tab, f"{text}.includes('[0.3, 0.14]')")
    start = tab.get_by_role("button", name="Compare the wheels")
    start.click()
    tab.wait_for_selector("#design-error:not([hidden])", timeout=LONG)
    box = "document.querySelector('#design-text')"
    line = tab.evaluate(f"{box}.value.slice({box}.selectionStart, {box}.selectionEnd)")
    assert line.startswith("width = [0.3, 0.14]")
    tab.get_by_label("Width (mm), from").fill("100")
    tab.keyboard.press("Tab")
    until(tab, f"{text}.includes('[0.1, 0.14]')")
    tab.get_by_role("button", name="leave out wang2016/kls1").click()
    until(tab, f"!{text}.includes('kls1')")
    tab.select_option("#design-effort", "quick")
    start.click()
    tab.wait_for_selector("#design-result .verdict", timeout=LONG)
    assert "climbs 8 deg" in tab.locator("#design-result .sentence").inner_text()
    assert tab.locator("#design-result table").first.is_hidden()
    tab.get_by_text("The best design on each soil").click()
    assert tab.locator("#design-result table").nth(1).is_visible()
    for width, scheme in ((1280, "light"), (390, "dark")):
        tab.emulate_media(color_scheme=scheme)
        tab.set_viewport_size({"width": width, "height": 800})
        until(tab, f"document.documentElement.scrollWidth <= {width}")
        assert tab.evaluate(CONTRAST) == [] and tab.evaluate(NAMELESS) == []


#: Contrast of every visible text with what is behind it, by WCAG 2; the worst ones.
CONTRAST = """() => {
  const parse = (c) => (c.match(/[\\d.]+/g) || []).map(Number);
  const light = (c) => { const f = (v) => { v /= 255; return v <= 0.04045 ? v / 12.92
    : ((v + 0.055) / 1.055) ** 2.4; }; return 0.2126*f(c[0]) + 0.7152*f(c[1]) + 0.0722*f(c[2]); };
  const ground = (e) => { while (e) { const c = parse(getComputedStyle(e).backgroundColor);
    if (c.length === 3 || c[3] > 0) return c; e = e.parentElement; } return [255, 255, 255]; };
  const bad = [];
  for (const e of document.querySelectorAll('main *, header *, footer *')) {
    const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    if (!own || !e.checkVisibility() || e.closest('svg') || e.disabled) continue;
    const [a, b] = [light(parse(getComputedStyle(e).color)), light(ground(e))];
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) bad.push([e.textContent.trim().slice(0, 30), ratio]);
  }
  return bad;
}"""
#: Controls without a name that a screen reader can say.
NAMELESS = """() => [...document.querySelectorAll('input, select, textarea, button, a')]
  .filter((e) => !(e.labels?.length || e.getAttribute('aria-label') || e.textContent.trim()))
  .map((e) => e.id)"""


def test_it_fits_has_contrast_and_names(tab, tmp_path):
    tab.set_input_files("#file", runs_file(tmp_path, Model(Wheel(radius=0.15, width=0.12))))
    tab.wait_for_selector("#ask-wheel:not([hidden])", timeout=LONG)
    assert tab.evaluate(CONTRAST) == [] and tab.evaluate(NAMELESS) == []
    confirm_the_wheel(tab)
    tab.wait_for_selector("#pull-result summary", timeout=LONG)
    while (closed := tab.locator("details:not([open]) > summary")).count():
        closed.first.click()
    for width, scheme in ((1280, "light"), (1280, "dark"), (360, "dark"), (360, "light")):
        tab.emulate_media(color_scheme=scheme)
        tab.set_viewport_size({"width": width, "height": 800})
        until(tab, f"document.documentElement.scrollWidth <= {width}")
        assert tab.evaluate(CONTRAST) == [], (width, scheme)
    assert tab.evaluate(NAMELESS) == []
    ids = tab.evaluate("[...document.querySelectorAll('[id]')].map((e) => e.id)")
    assert len(ids) == len(set(ids))


def test_the_keyboard_alone_reaches_everything(tab):
    reached = []
    for _ in range(40):
        tab.keyboard.press("Tab")
        reached.append(tab.evaluate("document.activeElement.id || document.activeElement.tagName"))
    assert {"wheel", "soil", "hold", "s-slip", "s-load", "s-shear_modulus", "file"} <= set(reached)
    assert tab.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none"
