#!/usr/bin/env python3
"""How long the dashboard takes to be seen with a full queue.

usage: dashboard_paint.py PATINAD [--jobs N] [--loads N]

Starts a patinad, pauses its queue, fills it with N jobs (10,000) of as many assets, and opens each view N times (9) in headless
Chromium over loopback. Prints the median and the range of the first contentful paint and of the moment at which the
view's own content is there, in milliseconds since the navigation began, and what was transferred.
"""

import argparse
import contextlib
import os
import platform
import sqlite3
import statistics
import sys
import tempfile

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "system"))
from chromium import Browser, Page, find_chromium  # noqa: E402
from dashboard_browser_test import TOKEN, Daemon  # noqa: E402

VIEWS = ("#/queue", "#/queue?state=queued%2Cretry_waiting", "#/assets", "#/machine")
TIMES = """(async () => {
  while (performance.getEntriesByName('patina-shown').length === 0) await new Promise(resolve => setTimeout(resolve, 10));
  await new Promise(resolve => requestAnimationFrame(() => setTimeout(resolve, 0)));
  const paint = performance.getEntriesByName('first-contentful-paint')[0];
  return [paint ? paint.startTime : null, performance.getEntriesByName('patina-shown')[0].startTime,
    performance.getEntriesByType('resource').reduce((sum, entry) => sum + entry.transferSize, 0),
    document.querySelectorAll('*').length];
})()"""


def machine():
    with open("/proc/cpuinfo") as file:
        names = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
    return f"{names[0] if names else platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"


def fill(daemon, count):
    """One job by the API, on a paused queue, and copies of it under other names in its database: each submission waits for
    the disk, and that is not what is measured."""
    folder = os.path.join(daemon.folder, "drop", "empty")
    os.makedirs(folder)
    daemon.post("/v1/queue/pause", {})
    daemon.post("/v1/jobs", {"job": {"kind": "material", "asset": "asset_00000", "folder": folder}})
    with contextlib.closing(sqlite3.connect(os.path.join(daemon.folder, "state", "queue.db"), timeout=60)) as database:
        copies = [(f"asset_{i:05d}",) for i in range(1, count)]
        columns = [row[1] for row in database.execute("PRAGMA table_info(jobs)") if row[1] not in ("id", "asset", "idempotency_key")]
        names = ", ".join(columns)
        with database:
            database.executemany(f"INSERT INTO jobs (asset, {names}) SELECT ?, {names} FROM jobs WHERE id = 1", copies)
            database.execute("INSERT INTO assets SELECT j.out, j.asset, a.source, a.signature, a.failed_file, j.id, a.updated_ms, a.gone "
                             "FROM jobs j, assets a WHERE j.id > 1")
    waiting = daemon.get("/v1/status")["jobs"]["queued"]
    if waiting != count:
        raise RuntimeError(f"{waiting} jobs wait, not {count}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("patinad")
    parser.add_argument("--jobs", type=int, default=10000)
    parser.add_argument("--loads", type=int, default=9)
    options = parser.parse_args()
    program = find_chromium()
    if not program:
        print("no Chromium here (apt install chromium)", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        daemon = Daemon(os.path.abspath(options.patinad), "/bin/true", scratch)
        try:
            fill(daemon, options.jobs)
            browser = Browser(program, os.path.join(scratch, "profile"))
            try:
                page = Page(browser)
                page.look(1280, "light")
                page.open(daemon.url + "/web/icon.svg")
                page.value(f"sessionStorage.setItem('patina-token', '{TOKEN}')")
                print(f"{machine()}; {options.jobs} jobs; median (least to most) of {options.loads} loads, ms")
                for view in VIEWS:
                    rows = []
                    for _ in range(options.loads):
                        page.open("about:blank")
                        page.open(daemon.url + "/" + view)
                        rows.append(page.value(TIMES))
                    cells = []
                    for name, at in (("first paint", 0), ("content", 1)):
                        values = [row[at] for row in rows if row[at] is not None]
                        cells.append(f"{name} {statistics.median(values):.0f} ({min(values):.0f} to {max(values):.0f})")
                    print(f"{view:40} {', '.join(cells)}, {rows[-1][2] / 1000:.0f} kB, {rows[-1][3]} elements")
            finally:
                browser.close()
        finally:
            daemon.stop()
    return 0


if __name__ == "__main__":
    sys.exit(main())
