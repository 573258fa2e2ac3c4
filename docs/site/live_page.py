"""Draw docs/serve.png: the live page with the verdict on its example.

    python docs/site/live_page.py [FILE.png]

Needs `pip install '.[browser]'` and Chromium (SOILML_CHROMIUM=/path where it is not found).
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
SIZE = {"width": 1280, "height": 1000}  # Of the picture
LONG = 240_000  # Longest wait for the answer, ms


def main(target: Path) -> None:
    """Serve the page, ask for its example and take the picture."""
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
                tab.locator("#example").click()
                tab.wait_for_selector("#answers iframe", timeout=LONG)
                tab.wait_for_timeout(1500)  # the report is drawn in its frame
                tab.screenshot(path=target)
                browser.close()
        finally:
            server.terminate()


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/serve.png")
