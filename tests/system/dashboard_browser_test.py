#!/usr/bin/env python3
"""Uses the dashboard in Chromium as people do, with a patinad of its own.

usage: dashboard_browser_test.py PATINA PATINAD FOLDER

Gives the token, sends a small sample through the file input, watches it become a container, and looks at every view: on
a wide screen and on a phone, in the light and in the dark. Fails on an error in the browser's console, on a breach of
the content security policy, on content wider than the screen, on controls without a name, and on text that is hard to
read. Leaves a screenshot of each view in FOLDER, which is made anew. Exits with 77, saying so, without Chromium.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import urllib.request

from chromium import SKIPPED, SOFTWARE_GL, Browser, Page, find_chromium
from page_checks import AXE_MISSING, faults_of, has_axe

WIDTHS = (1280, 390)
SCHEMES = ("light", "dark")
TOKEN = "dashboard-test-token-0123456789"


class Daemon:
    """A patinad on a free port of loopback, with a state of its own."""

    def __init__(self, patinad, patina, folder):
        self.folder = folder
        os.makedirs(os.path.join(folder, "drop"))
        token = os.path.join(folder, "token")
        with open(os.open(token, os.O_WRONLY | os.O_CREAT, 0o600), "w") as file:
            file.write(TOKEN + "\n")
        self._process = subprocess.Popen(
            [patinad, "--watch", os.path.join(folder, "drop"), "--out", os.path.join(folder, "out"), "--state",
             os.path.join(folder, "state"), "--listen", "127.0.0.1:0", "--token-file", token, "--worker", patina],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.port = 0
        lines = []
        while self.port == 0:
            line = self._process.stderr.readline()
            if not line:
                raise RuntimeError("patinad has ended: " + "".join(lines))
            lines.append(line)
            found = re.search(r'"url": ?"http://127.0.0.1:([0-9]+)/"', line)
            self.port = int(found.group(1)) if found else 0
        self.url = f"http://127.0.0.1:{self.port}"
        # So that it never waits for a reader of its log.
        self._drain = subprocess.Popen(["cat"], stdin=self._process.stderr, stdout=subprocess.DEVNULL)

    def get(self, path):
        request = urllib.request.Request(self.url + path, headers={"Authorization": "Bearer " + TOKEN})
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)

    def post(self, path, body):
        request = urllib.request.Request(self.url + path, json.dumps(body).encode(), method="POST",
                                         headers={"Authorization": "Bearer " + TOKEN, "Content-Type": "application/json"})
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.load(answer)

    def stop(self):
        self._process.send_signal(signal.SIGTERM)
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(60)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._drain.wait()


def go(page, hash_text, title):
    page.value(f"location.hash = {json.dumps(hash_text)}")
    page.wait_until(f"document.title.startsWith({json.dumps(title)}) && !document.querySelector('main [role=alert]') "
                    "&& document.querySelector('main .facts, main table, main .cards')", "the view " + hash_text)


def use(page, daemon, sample, folder):
    """Everything that is wrong, as sentences."""
    wrong = []

    def check(name, wait="true"):
        backgrounds = set()
        for width in WIDTHS:
            for scheme in SCHEMES:
                page.look(width, scheme)
                page.wait_until(wait, "what is to be seen of " + name)
                view = f"{name}, {width} pixels, {scheme}"
                wrong.extend(f"{view}: {text}" for text in faults_of(page))
                wrong.extend(f"{view}: {text}" for text in page.complaints())
                page.screenshot(os.path.join(folder, f"{name}-{width}-{scheme}.png"))
                backgrounds.add(page.value("getComputedStyle(document.body).backgroundColor"))
        page.look(*[WIDTHS[0], SCHEMES[0]])
        if len(backgrounds) != len(SCHEMES):
            wrong.append(f"{name}: is as bright in the dark as in the light: {sorted(backgrounds)}")

    page.look(1280, "light")
    page.open(daemon.url + "/")
    page.wait_until("document.getElementById('ask').open", "the question for the token")
    # A browser reports each answer of 401 by itself.
    wrong.extend(text for text in page.complaints() if "401" not in text)
    check("token")
    give = """(token => { const input = document.getElementById('token'); input.value = token;
      document.querySelector('#ask form').requestSubmit(); return true; })"""
    page.value(give + "('not-the-token-at-all')")
    page.wait_until("document.getElementById('ask').open && !document.getElementById('ask-wrong').hidden", "that it is refused")
    page.value(give + f"({json.dumps(TOKEN)})")
    page.wait_until("document.querySelector('#link.up') && document.querySelector('main .facts')", "the queue")
    wrong.extend(text for text in page.complaints() if "401" not in text)
    if TOKEN in page.value("document.cookie + JSON.stringify(localStorage) + location.href + document.documentElement.outerHTML"):
        wrong.append("the token is where it does not belong")
    check("queue-empty")

    # A set through the file input, at work and done.
    page.value("document.getElementById('quality').value = 'preview'; true")
    page.choose_files("#files", [os.path.join(sample, name) for name in sorted(os.listdir(sample)) if name.endswith(".png")])
    job = page.wait_until("(document.querySelector('.sent a[href^=\"#/job/\"]') || {}).hash", "the job of the upload")
    go(page, job, "Job")
    page.wait_until("document.querySelector('.plot .line') || document.querySelector('main .is-succeeded')", "accuracy against time")
    check("job-running")
    page.wait_until("document.querySelector('main .is-succeeded')", "the container", 400)
    page.wait_until("document.querySelector('.plot .line') && document.querySelector('pre.log').textContent.includes('attempt 1')", "curve and log")
    check("job-done")
    asset = daemon.get("/v1/jobs/" + job.split("/")[-1])["asset"]

    # Hostile names and a failure; and a second revision of the first asset.
    broken = os.path.join(sample, "<img src=x onerror=alert(1)>_albedo.png")
    whole = [name for name in os.listdir(sample) if "basecolor" in name][0]
    with open(os.path.join(sample, whole), "rb") as source, open(broken, "wb") as file:
        file.write(source.read()[:2000])
    go(page, "#/queue", "Queue")
    page.choose_files("#files", [broken])
    page.wait_until("document.querySelectorAll('.sent li a[href^=\"#/job/\"]').length >= 2", "the job of the broken file")
    page.wait_until("document.querySelector('.jobs .is-failed')", "that it fails")
    os.remove(broken)
    if page.value("document.querySelectorAll('main img, main script').length") != 0:
        wrong.append("text of a file's name became markup")
    request = daemon.get("/v1/jobs/" + job.split("/")[-1])["job"]
    request["seed"] = 2
    daemon.post("/v1/jobs", {"job": request})
    page.wait_until("document.querySelectorAll('.jobs .is-succeeded').length >= 2", "the second revision", 400)
    check("queue", "document.querySelector('.jobs .is-failed')")

    go(page, "#/assets", "Assets")
    check("assets", "document.querySelector('.picture canvas') && document.querySelector('.figures b')")
    go(page, "#/asset/" + asset, asset)
    check("asset", "document.querySelector('.sheet canvas') && document.querySelectorAll('table.numbers thead th').length === 4")
    go(page, "#/machine", "Machine")
    check("machine")

    # The viewer, in the same tab and so with the same token.
    go(page, "#/asset/" + asset, asset)
    page.open(page.value("document.querySelector('[data-key=view]').href"))
    page.wait_until("document.title.endsWith('Patina viewer') && document.querySelector('#status.up')", "the viewer of the current revision")
    if page.value("[...document.querySelectorAll('#pick-show option')].length") < 4:
        wrong.append("the viewer of the dashboard shows no maps")
    check("viewer")
    page.open(daemon.url + "/web/viewer.html?asset=" + asset + "&revision=r0099")
    page.wait_until("document.querySelector('#trouble [role=alert]')", "word that there is no such revision")
    page.complaints()  # the browser reports the answer of 404 by itself
    page.open(daemon.url + "/")
    page.wait_until("document.querySelector('#link.up')", "the queue")

    # A report opens in a tab of its own, although a link cannot carry the token.
    go(page, "#/asset/" + asset, asset)
    opened = page.value("""(async () => {
      const urls = [];
      window.open = () => ({location: {replace: url => urls.push(url)}, close() {}});
      document.querySelector('[data-key=report]').click();
      for (let i = 0; i < 200 && urls.length === 0; ++i) await new Promise(resolve => setTimeout(resolve, 50));
      return urls[0];
    })()""")
    page.open(daemon.url + opened)
    if asset not in page.value("document.querySelector('h1').textContent"):
        wrong.append("the report does not open")
    wrong.extend(f"report: {text}" for text in page.complaints())

    # By keyboard alone: the first stop leads past the menu, and every stop can be seen.
    page.open(daemon.url + "/")
    page.wait_until("document.querySelector('main .facts')", "the queue again")
    stops = []
    for _ in range(12):
        for kind in ("keyDown", "keyUp"):
            page.call("Input.dispatchKeyEvent", type=kind, key="Tab", code="Tab", windowsVirtualKeyCode=9)
        stops.append(page.value("""(() => { const at = document.activeElement, style = getComputedStyle(at);
          const outlined = style.outlineStyle !== 'none' || (at.nextElementSibling && getComputedStyle(at.nextElementSibling).outlineStyle !== 'none');
          return [at.tagName, at.id || at.textContent.trim().slice(0, 40), outlined]; })()"""))
    if stops[0][1] != "Skip to the content":
        wrong.append(f"the first stop of the keyboard is {stops[0]}")
    wrong.extend(f"the focus cannot be seen on {stop}" for stop in stops if not stop[2] and stop[0] != "BODY")
    if not any(stop[1] == "files" for stop in stops):
        wrong.append(f"the keyboard does not reach the file input: {stops}")
    wrong.extend(page.complaints())
    return wrong


def main():
    if len(sys.argv) != 4:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    patina, patinad, folder = (os.path.abspath(path) for path in sys.argv[1:])
    program = find_chromium()
    if not program:
        print("SKIPPED: no Chromium here (apt install chromium): nobody has looked at the dashboard")
        return SKIPPED
    if not has_axe():
        print(AXE_MISSING)
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        sample = os.path.join(scratch, "sample")
        subprocess.run([patina, "sample", "--out", sample, "--size", "128"], check=True, stdout=subprocess.DEVNULL)
        daemon = Daemon(patinad, patina, scratch)
        try:
            browser = Browser(program, os.path.join(scratch, "profile"), SOFTWARE_GL)
            try:
                wrong = use(Page(browser), daemon, sample, folder)
            finally:
                browser.close()
        finally:
            daemon.stop()
    for text in wrong:
        print("WRONG: " + text, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
