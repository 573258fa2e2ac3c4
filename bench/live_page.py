"""Draw docs/serve.png: the live page with curves held at one shear modulus, drawn at another.

    python bench/live_page.py [FILE.png]

Needs `pip install 'soilml[browser]'` and Chromium (SOILML_CHROMIUM=/path where it is not found).
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: Size of the picture, and the shear moduli (mm) that are held and shown.
SIZE = {"width": 1280, "height": 1000}
HELD, SHOWN = "25", "10"


def main(target: Path) -> None:
    """Serve the page, move its sliders and take the picture."""
    from playwright.sync_api import sync_playwright

    program = os.environ.get("SOILML_CHROMIUM") or shutil.which("chromium")
    command = [sys.executable, "-m", "soilml", "serve", "--port", "0", "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as server:
        try:
            assert server.stdout is not None
            found = re.search(r"http://127\.0\.0\.1:\d+/", server.stdout.readline())
            assert found, "the page is not served"
            with sync_playwright() as play:
                browser = play.chromium.launch(executable_path=program, args=["--no-sandbox"])
                tab = browser.new_page(viewport=SIZE)
                tab.goto(found[0])
                tab.wait_for_selector("html[data-ready=yes] #now div")
                modulus = tab.locator("#s-shear_modulus")
                for value in (HELD, SHOWN):
                    before = tab.locator("#now").inner_text() if value == SHOWN else ""
                    modulus.fill(value)
                    modulus.press("Enter")
                    while tab.locator("#now").inner_text() == before:
                        tab.wait_for_timeout(50)
                    if value == HELD:
                        tab.wait_for_timeout(500)
                        tab.locator("#hold").click()
                tab.wait_for_timeout(500)
                tab.locator("body").click(position={"x": 5, "y": 60})
                tab.screenshot(path=target)
                browser.close()
        finally:
            server.terminate()


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/serve.png")
