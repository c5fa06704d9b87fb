"""Frames a second of the explorer in headless Chromium, while a slider moves at every frame.

Run ``python benches/explorer.py [--quick]``. It needs Playwright for Python and a chromium; the
physical limit is the 60 frames a second of the screen.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path

import deadtime as dtm

#: Move the delay once a frame, and take the time of each drawing and of all frames.
MOVED = """async (frames) => {
  const slider = document.getElementById("range-delay");
  const next = () => new Promise((done) => requestAnimationFrame(done));
  const took = [];
  for (let i = -20; i < frames; i++) {
    if (i === 0) window.began = performance.now();
    slider.value = 0.2 + (0.2 * (i + 20)) / (frames + 20);
    slider.dispatchEvent(new Event("input"));
    await next();
    if (i >= 0) took.push(window.drawn.took);
  }
  const seconds = (performance.now() - window.began) / 1000;
  took.sort((one, two) => one - two);
  return [frames / seconds, took[frames >> 1], took[Math.floor(0.95 * frames)]];
}"""

LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.5, 0.13), delay=0.3, limit=1.0)
RANGES = {"Kp": (0.0, 6.0), "Kv": (-0.9, 0.9)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few frames")
    frames = 20 if parser.parse_args().quick else 300
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("pip install playwright")
        return
    if chromium is None:
        print("there is no chromium on this machine")
        return
    print(f"{'cells':34}{'frames/s':>9}{'script ms':>11}{'95 % below':>12}")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as run:
        browser = run.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for name, loop in (
            ("300 x 300 continuous", LOOP),
            ("150 x 150 sampled every 65 ms", LOOP.replace(sample_time=0.065)),
            ("150 x 150 sampled every 20 ms", LOOP.replace(sample_time=0.02)),
        ):
            page = loop.explore(RANGES).save(Path(folder) / "loop.html")
            tab = browser.new_page(viewport={"width": 1400, "height": 1000})
            tab.goto(page.as_uri())
            tab.wait_for_selector("body[data-ready=yes]")
            rate, middle, late = tab.evaluate(MOVED, frames)
            print(f"{name:34}{rate:9.0f}{middle:11.1f}{late:12.1f}", flush=True)
            tab.close()
        browser.close()


if __name__ == "__main__":
    main()
