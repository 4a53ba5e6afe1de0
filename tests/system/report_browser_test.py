#!/usr/bin/env python3
"""Opens report pages in Chromium, as their readers do: on a wide screen and on a phone, in the light and in the dark.

usage: report_browser_test.py FOLDER

For each *.html in FOLDER: fails on an error in the browser's console, on a request for anything that is not part of the
page, on a picture that does not load, on content wider than the screen, and on a source that does not come to lie over
a decoded picture in focus. Leaves a screenshot of each view beside it.
Exits with 77, saying so, where there is no Chromium.
"""

import base64
import glob
import os
import sys
import tempfile

from chromium import SKIPPED, Browser, find_chromium

WIDTHS = (1280, 390)
SCHEMES = ("light", "dark")
LOOK = """(() => ({
  overflow: document.documentElement.scrollWidth - document.documentElement.clientWidth,
  height: document.documentElement.scrollHeight,
  broken: [...document.images].filter(image => !image.complete || image.naturalWidth === 0).map(image => image.alt),
  images: document.images.length,
  flip: (() => {
    const row = [...document.querySelectorAll('.row')].find(row => row.querySelector('.source img'));
    if (!row) return 0;
    const [source, decoded] = [row.querySelector('.source img'), row.querySelector('.decoded img')];
    decoded.focus({preventScroll: true});
    const [a, b] = [source.getBoundingClientRect(), decoded.getBoundingClientRect()];
    decoded.blur();
    return Math.hypot(a.x - b.x, a.y - b.y);
  })(),
  heading: document.querySelector('h1').textContent,
  background: getComputedStyle(document.body).backgroundColor
}))()"""


def complaints(events):
    for event in events:
        method, parameters = event.get("method"), event.get("params", {})
        if method == "Log.entryAdded":
            yield "console: " + parameters["entry"]["text"][:200]
        elif method == "Runtime.exceptionThrown":
            yield "exception: " + parameters["exceptionDetails"]["text"]
        elif method == "Network.requestWillBeSent":
            url = parameters["request"]["url"]
            if not url.startswith(("file:", "data:")):
                yield "fetches " + url


def check_page(browser, path):
    """Everything that is wrong with a page, as sentences."""
    target = browser.call("Target.createTarget", url="about:blank")["targetId"]
    session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
    for domain in ("Page", "Log", "Runtime", "Network"):
        browser.call(domain + ".enable", session)
    browser.call("Emulation.setFocusEmulationEnabled", session, enabled=True)
    wrong, backgrounds = [], set()
    for width in WIDTHS:
        for scheme in SCHEMES:
            browser.call("Emulation.setDeviceMetricsOverride", session, width=width, height=900,
                         deviceScaleFactor=1, mobile=width < 600)
            browser.call("Emulation.setEmulatedMedia", session,
                         features=[{"name": "prefers-color-scheme", "value": scheme}])
            browser.events = []
            browser.call("Page.navigate", session, url="file://" + os.path.abspath(path))
            browser.wait_for("Page.loadEventFired")
            seen = browser.call("Runtime.evaluate", session, expression=LOOK, returnByValue=True)["result"]["value"]
            view = f"{os.path.basename(path)} at {width} pixels, {scheme}"
            wrong += [f"{view}: {text}" for text in complaints(browser.events)]
            if seen["overflow"] > 0:
                wrong.append(f"{view}: {seen['overflow']} pixels wider than the screen")
            if seen["broken"]:
                wrong.append(f"{view}: pictures do not load: {seen['broken']}")
            if seen["flip"] > 1:
                wrong.append(f"{view}: the source lies {seen['flip']:.0f} pixels beside the decoded picture in focus")
            if not seen["heading"].strip():
                wrong.append(f"{view}: no heading")
            backgrounds.add((scheme, seen["background"]))
            shot = browser.call("Page.captureScreenshot", session, captureBeyondViewport=True,
                                clip={"x": 0, "y": 0, "width": width, "height": seen["height"], "scale": 1})
            with open(f"{os.path.splitext(path)[0]}-{width}-{scheme}.png", "wb") as file:
                file.write(base64.b64decode(shot["data"]))
            print(f"{view}: {seen['images']} pictures, {seen['height']} pixels long")
    if len({color for _, color in backgrounds}) != len(SCHEMES):
        wrong.append(f"{os.path.basename(path)}: is as bright in the dark as in the light: {sorted(backgrounds)}")
    browser.call("Target.closeTarget", targetId=target)
    return wrong


def main():
    if len(sys.argv) != 2:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    program = find_chromium()
    if not program:
        print("SKIPPED: no Chromium here (apt install chromium): nobody has looked at the report pages")
        return SKIPPED
    pages = sorted(glob.glob(os.path.join(glob.escape(sys.argv[1]), "*.html")))
    if not pages:
        print(f"no pages in {sys.argv[1]}", file=sys.stderr)
        return 1
    wrong = []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(program, profile)
        try:
            for page in pages:
                wrong += check_page(browser, page)
        finally:
            browser.close()
    for text in wrong:
        print("WRONG: " + text, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
