"""Look at built pages in a browser: ``python docs/look.py docs/_build/html``.

On a desk and on a phone, light and dark: no page says anything in the console, scrolls sideways or
has a serious finding of axe; no page of the reference is too long to find something in it; and the
search finds the words that people of the field use. It needs Playwright, axe and Chromium, and does
nothing without them.
"""

from __future__ import annotations

import shutil
import sys
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from importlib.util import find_spec
from pathlib import Path
from typing import Any

#: One page of each kind.
PAGES = (
    "index",
    "start/install",
    "guide/estimate",
    "guide/from-recording-to-gains",
    "guide/maps",
    "guide/latency-of-a-vehicle",
    "examples/index",
    "examples/maps/gains_that_are_stable",
    "reference/index",
    "reference/loops",
    "reference/loops/control-loops",
    "theory/promises",
    "theory/sampled-loops",
    "paper/reproduction",
    "explorer",
)
WIDTHS = (1440, 390)
SCHEMES = ("light", "dark")

#: Longest page of the reference at the larger width, pixels: longer ones nobody reads to their end.
LONGEST = 8000

#: What people search for, with the page that has to be among the first results.
WORDS = {
    "dead time": "guide/estimate",
    "FOPDT": "guide/estimate",
    "PI": "guide/design",
    "SIMC": "guide/design",
    "bump test": "guide/estimate",
    "python-control": "start/from-python-control",
    "matrices": "reference/systems/systems-of-matrices",
    "lag": "theory/terms",
    "latency": "guide/latency-of-a-vehicle",
    "estimate_delay": "reference/estimation/estimate-a-delay",
}
FIRST = 10

#: Longest time of a search, ms: on a busy machine one of a thousand results takes half a minute.
PATIENCE = 180_000


class Quiet(SimpleHTTPRequestHandler):
    """Serves the pages without a line for each request."""

    def log_message(self, *args: Any) -> None:
        """Say nothing."""


def looked_at(browser: Any, address: str) -> Iterator[str]:
    """What is wrong with the pages, at each width and in each scheme."""
    from axe_playwright_python.sync_playwright import Axe

    for scheme in SCHEMES:
        tab = browser.new_context(color_scheme=scheme).new_page()
        said: list[str] = []
        tab.on("console", lambda message, said=said: said.append(message.text))
        tab.on("pageerror", lambda error, said=said: said.append(str(error)))
        for page in PAGES:
            for width in WIDTHS:
                where = f"{page} at {width} pixels, {scheme}"
                tab.set_viewport_size({"width": width, "height": 900})
                tab.goto(f"{address}/{page}.html", wait_until="load")
                shown = tab.evaluate("() => document.documentElement.scrollWidth")
                if shown > width:
                    yield f"{where}: {shown} pixels wide"
                for found in Axe().run(tab).response["violations"]:
                    if found["impact"] in ("serious", "critical"):
                        nodes = [node["html"][:100] for node in found["nodes"][:3]]
                        yield f"{where}: {found['id']} at {nodes}"
                yield from (f"{where}: the console says {one}" for one in said)
                said.clear()


def too_long(browser: Any, address: str, root: Path) -> Iterator[str]:
    """Pages of the reference that are too long."""
    tab = browser.new_page(viewport={"width": WIDTHS[0], "height": 900})
    for path in sorted((root / "reference").rglob("*.html")):
        page = path.relative_to(root).as_posix()
        tab.goto(f"{address}/{page}", wait_until="load")
        height = tab.evaluate("() => document.documentElement.scrollHeight")
        if height > LONGEST:
            yield f"{page}: {height} pixels high"


def not_found(browser: Any, address: str) -> Iterator[str]:
    """Words that the search does not lead to their page."""
    tab = browser.new_page()
    tab.set_default_timeout(PATIENCE)
    for word, page in WORDS.items():
        tab.goto(f"{address}/search.html?q={word}")
        tab.wait_for_selector("#search-results p.search-summary:not(:empty)")
        tab.wait_for_function(
            "() => !document.querySelector('#search-progress')?.textContent.trim()"
        )
        links = tab.evaluate(
            "() => [...document.querySelectorAll('#search-results li a')].map((one) => one.href)"
        )
        first = [link.split("?")[0].removeprefix(f"{address}/").split(".html")[0] for link in links]
        if page not in first[:FIRST]:
            yield f"searching {word!r} finds {first[:FIRST]}, and not {page}"


def main() -> int:
    """Print what is wrong, and return the exit code."""
    root = Path(sys.argv[1]).resolve()
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if not (program and find_spec("playwright") and find_spec("axe_playwright_python")):
        print("there is no browser here: the pages were not looked at")
        return 0
    from playwright.sync_api import sync_playwright

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=root))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_port}"
    with sync_playwright() as run:
        browser = run.chromium.launch(executable_path=program, args=["--no-sandbox"])
        wrong = [
            *too_long(browser, address, root),
            *not_found(browser, address),
            *looked_at(browser, address),
        ]
    server.shutdown()
    print("\n".join(wrong) or f"{len(PAGES)} pages and {len(WORDS)} searches are as they should be")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
