#!/usr/bin/env python3
"""What a frame of the viewer costs in a browser without a graphics card.

usage: viewer_frames.py PATINA [CONTAINER...] [--runs N]

Shows each container (none: a sample of 512 x 512 texels and one of a BRDF, baked at preview) in headless Chromium with
SwiftShader, lit, on plane, sphere and cube, and presses the viewer's own "Measure a frame" N times (7) for each, in turn.
Prints the median and the range of milliseconds for a frame of 512 x 512 pixels, and frames a second.
"""

import argparse
import os
import platform
import statistics
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "system"))
from chromium import SOFTWARE_GL, Browser, Page, find_chromium  # noqa: E402
from viewer_browser_test import Viewer, pick, show  # noqa: E402

SHAPES = ("plane", "sphere", "cube")


def machine():
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        names = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
    return f"{names[0] if names else platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"


def samples(patina, scratch):
    folder, baked = os.path.join(scratch, "sample"), os.path.join(scratch, "baked")
    subprocess.run([patina, "sample", "--out", folder, "--size", "512", "-q"], check=True, stdout=subprocess.DEVNULL)
    subprocess.run([patina, "bake", folder, "--out", baked, "--quality", "preview", "--no-report", "-q"], check=True, stdout=subprocess.DEVNULL)
    return [os.path.join(baked, name) for name in sorted(os.listdir(baked)) if os.path.isdir(os.path.join(baked, name, "current"))]


def measure(page):
    page.value("delete document.getElementById('cost').dataset.ms; document.getElementById('measure').click(); true")
    return float(page.wait_until("document.getElementById('cost').dataset.ms", "the cost of a frame"))


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("usage: ")[1].split("\n")[0])
    parser.add_argument("patina")
    parser.add_argument("containers", nargs="*")
    parser.add_argument("--runs", type=int, default=7)
    given = parser.parse_args()
    program = find_chromium()
    if not program:
        print("no Chromium here (apt install chromium)", file=sys.stderr)
        return 1
    print(machine())
    print(f"{'container':24} {'shape':8} {'ms':>8} {'least':>8} {'most':>8} {'frames/s':>9}")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        browser = Browser(program, os.path.join(scratch, "profile"), SOFTWARE_GL)
        try:
            page = Page(browser)
            page.look(1280, "light")
            for container in given.containers or samples(given.patina, scratch):
                viewer = Viewer(given.patina, container)
                try:
                    show(page, viewer)
                    times = {shape: [] for shape in SHAPES}
                    for _ in range(given.runs):
                        for shape in SHAPES:
                            pick(page, "shape", shape)
                            times[shape].append(measure(page))
                    for shape, found in times.items():
                        middle = statistics.median(found)
                        print(f"{os.path.basename(container):24} {shape:8} {middle:8.1f} {min(found):8.1f} {max(found):8.1f} {1000 / middle:9.1f}")
                finally:
                    viewer.stop()
        finally:
            browser.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
