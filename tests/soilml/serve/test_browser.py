"""The live page in a headless Chromium, with real clicks and keys."""

import os
import shutil
import sys

import pytest
from served_page import ROOT, runs_file
from served_page import page as page

from soilml import Model, Operating, Wheel, soil

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


def answer(tab, title):
    """The report below a title, once it is as high as its content."""
    place = f"[data-title='{title}'] iframe"
    tab.wait_for_selector(f"{place}, #answer-error:not([hidden])", timeout=LONG)
    inner = f"document.querySelector(`{place}`)"
    until(tab, f"!!{inner}.contentDocument?.querySelector('h1, h2')")
    until(tab, f"{inner}.contentDocument.documentElement.scrollHeight <= {inner}.clientHeight + 2")
    return tab.frame_locator(place)


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
    tab.get_by_role("button", name="Reset").click()
    until(tab, f"document.querySelector('#now dd').innerText.startsWith('{first['Torque']}')")
    assert now(tab) == first


def test_the_example_leads_to_a_verdict_a_cause_and_a_better_soil(tab):
    """From an empty page by three clicks; an analysis can be cancelled."""
    tab.get_by_role("button", name="Try an example").click()
    assert "does not fit" in answer(tab, "The soil").locator("body").inner_text()
    start = tab.get_by_role("button", name="What does the model lack?")
    start.click()
    tab.locator("#answer-job").get_by_role("button", name="Cancel").click()
    tab.wait_for_selector("#answer-job", state="hidden")
    until(tab, "!document.querySelector('#ask-gap').disabled")
    assert tab.locator("iframe").count() == 1
    start.click()
    report = answer(tab, "What does the model lack?")
    assert "slip-sinkage" in report.locator("body").inner_text()
    assert report.locator("img, svg").first.is_visible()
    tab.get_by_role("button", name="Use the returned model").click()
    until(tab, "document.querySelector('#answers article').dataset.title === 'The soil'")
    assert "slip-sinkage" in tab.locator("#model-text").input_value()
    assert "does not fit" not in answer(tab, "The soil").locator("body").inner_text()
    tab.get_by_role("button", name="Show this soil in the forward model").click()
    until(tab, "Math.abs(document.querySelector('#s-friction_angle').value - 28) < 3")
    with tab.expect_download() as saved:
        tab.get_by_role("link", name="Save gap.json").click()
    assert saved.value.suggested_filename == "gap.json"


def test_a_dropped_table_needs_its_wheel_and_a_wrong_model_is_shown_in_its_line(tab, tmp_path):
    tab.set_input_files("#file", runs_file(tmp_path, Model(Wheel(radius=0.15, width=0.12))))
    tab.get_by_label("Radius (mm)").fill("150")
    tab.get_by_label("Width (mm)", exact=True).fill("120")
    tab.select_option("#wheel-soil", "wong1989/dry_sand")
    assert tab.locator("#ask").is_hidden()
    tab.get_by_role("button", name="Use this wheel").click()
    tab.wait_for_selector("#answers iframe", timeout=LONG)
    answer(tab, "The soil")
    tab.locator("#model-box summary").click()
    text = tab.locator("#model-text")
    assert "\nsinkage_m = 0.001" in text.input_value()
    text.fill(text.input_value().replace("width = 0.12", "width = -3"))
    tab.get_by_role("button", name="Pull and slope").click()
    tab.wait_for_selector("#answer-error:not([hidden])", timeout=LONG)
    line = tab.evaluate(
        "(() => { const b = document.querySelector('#model-text');"
        " return b.value.slice(b.selectionStart, b.selectionEnd); })()"
    )
    assert line.startswith("width = -3")


def test_a_raw_log_asks_for_what_it_does_not_state(tab, tmp_path):
    sys.path.insert(0, str(ROOT / "examples" / "import"))
    from rig import write_logs

    tab.set_input_files("#file", write_logs(tmp_path / "rig")[:1])
    tab.wait_for_selector("#map-open input", timeout=LONG)
    tab.locator("#map-open input").first.fill("99")
    tab.get_by_role("button", name="Import").click()
    answer(tab, "The imported log")
    assert tab.get_by_label("Radius (mm)").input_value()


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
#: Labels that are cut by their own box.
CUT = """() => [...document.querySelectorAll('label, dt, dd, h1, h2, h3, button, .unit, .note')]
  .filter((e) => e.checkVisibility() && e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0)
  .map((e) => e.textContent)"""


def test_it_fits_has_contrast_and_names(tab):
    tab.get_by_role("button", name="Try an example").click()
    answer(tab, "The soil")
    while (closed := tab.locator("main details:not([open]) > summary:visible")).count():
        closed.first.click()
    for width, scheme in ((1280, "light"), (1280, "dark"), (390, "dark"), (360, "light")):
        tab.emulate_media(color_scheme=scheme)
        tab.set_viewport_size({"width": width, "height": 800})
        until(tab, f"document.documentElement.scrollWidth <= {width}")
        assert tab.evaluate(CONTRAST) == [], (width, scheme)
        assert tab.evaluate(CUT) == [], (width, scheme)
        assert "10^" not in tab.locator("main").inner_text()
    assert tab.evaluate(NAMELESS) == []
    ids = tab.evaluate("[...document.querySelectorAll('[id]')].map((e) => e.id)")
    assert len(ids) == len(set(ids))


def test_the_keyboard_alone_reaches_everything(tab):
    reached = []
    for _ in range(40):
        tab.keyboard.press("Tab")
        reached.append(tab.evaluate("document.activeElement.id || document.activeElement.tagName"))
    wanted = {"file", "example", "wheel", "soil", "reset", "s-slip", "s-load", "s-shear_modulus"}
    assert wanted <= set(reached)
    assert tab.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none"
