#!/usr/bin/env python3
"""How long the dashboard takes to be seen with a full queue.

usage: dashboard_paint.py PATINAD [--jobs N] [--loads N]

Starts a patinad, pauses its queue, submits N jobs (10,000) of as many assets, and opens each view N times (9) in headless
Chromium over loopback. Prints the median and the range of the first contentful paint and of the moment at which the
view's own content is there, in milliseconds since the navigation began, and what was transferred.
"""

import argparse
import http.client
import json
import os
import platform
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


def submit(daemon, folder, count):
    os.makedirs(folder)
    connection = http.client.HTTPConnection("127.0.0.1", daemon.port, timeout=120)
    headers = {"Authorization": "Bearer " + TOKEN, "Content-Type": "application/json"}

    def post(path, body):
        nonlocal connection
        for _ in range(2):  # a connection serves a few requests
            try:
                connection.request("POST", path, json.dumps(body), headers)
                answer = connection.getresponse()
                text = answer.read()
                if answer.status not in (200, 202):
                    raise RuntimeError(f"{path}: {answer.status} {text[:300]}")
                return
            except (http.client.RemoteDisconnected, ConnectionError):
                connection.close()
                connection = http.client.HTTPConnection("127.0.0.1", daemon.port, timeout=120)
        raise RuntimeError(path + ": no answer")

    post("/v1/queue/pause", {})
    for i in range(count):
        post("/v1/jobs", {"job": {"kind": "material", "asset": f"asset_{i:05d}", "folder": folder}})
        if i % 1000 == 999:
            print(f"{i + 1} jobs", file=sys.stderr)
    connection.close()


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
            submit(daemon, os.path.join(scratch, "drop", "empty"), options.jobs)
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
