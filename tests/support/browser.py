"""Pages in a real browser: Chromium, driven by Playwright; skips where there is none."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

#: How long a page may take on a busy machine, ms.
PATIENCE = 300_000


def patient(make: Callable[..., Any]) -> Callable[..., Any]:
    """The same maker of pages or contexts, whose pages may take as long as that."""

    def made(**given: Any) -> Any:
        page = make(**given)
        page.set_default_timeout(PATIENCE)
        return page

    return made


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser. While it is open, no other loop of asyncio can run in this thread."""
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("there is no chromium on this machine")
    with playwright.sync_playwright() as run:
        started = run.chromium.launch(executable_path=program, args=["--no-sandbox"])
        started.new_context, started.new_page = (
            patient(started.new_context),
            patient(started.new_page),
        )
        yield started
        started.close()


def check_tab(tab: Any, width: int) -> None:
    """No serious finding of axe, and nothing wider than the window."""
    axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is missing")
    assert tab.evaluate("() => document.documentElement.scrollWidth") <= width
    found = axe.Axe().run(tab).response["violations"]
    serious = [one for one in found if one["impact"] in ("serious", "critical")]
    assert [(one["id"], [node["html"] for node in one["nodes"]]) for one in serious] == []


def check_page(path: Path) -> None:
    """Open a page offline, light on a desk and dark on a phone: no message, no serious finding.

    Axe does not see the parts of the pictures, which take it longest, nor the explorer in a frame,
    which has a test of its own.
    """
    with chromium() as browser:
        tab = browser.new_context(offline=True).new_page()
        said: list[str] = []
        tab.on("console", lambda message: said.append(message.text))
        tab.on("pageerror", lambda error: said.append(str(error)))
        tab.goto(path.as_uri())
        assert said == []
        tab.evaluate("() => document.querySelectorAll('svg g, iframe').forEach((e) => e.remove())")
        for scheme, width in (("light", 1300), ("dark", 390)):
            tab.emulate_media(color_scheme=scheme)
            tab.set_viewport_size({"width": width, "height": 900})
            check_tab(tab, width)
