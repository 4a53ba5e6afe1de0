"""Chromium, for tests that look at pages as their readers do."""

import base64
import json
import os
import shutil
import subprocess
import time

SKIPPED = 77
# WebGL without a graphics card, by SwiftShader: slow, exact, and the same everywhere.
SOFTWARE_GL = ("--use-angle=swiftshader", "--use-gl=angle", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
TIMEOUT_S = 120  # of one answer; a hang is a failure, not a measure of speed


def find_chromium():
    """The program, or None."""
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


class Browser:
    """Chromium, spoken to over a pair of pipes: JSON messages that end in a zero byte."""

    def __init__(self, program, profile, graphics=("--disable-gpu",)):
        from_us, self._out = os.pipe()
        self._in, to_us = os.pipe()

        def pipes():
            # Away from 3 and 4 first, in case one of them is where the other has to go.
            reader, writer = os.dup(from_us), os.dup(to_us)
            os.dup2(reader, 3)
            os.dup2(writer, 4)

        self._process = subprocess.Popen(
            [program, "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", *graphics,
             "--disable-background-networking", "--disable-component-update", "--disable-sync",
             "--disable-dev-shm-usage", "--user-data-dir=" + profile, "--remote-debugging-pipe", "about:blank"],
            preexec_fn=pipes, pass_fds=(3, 4), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL)
        os.close(from_us)
        os.close(to_us)
        self._buffer = b""
        self._number = 0
        self.events = []

    def _message(self):
        while b"\0" not in self._buffer:
            chunk = os.read(self._in, 1 << 16)
            if not chunk:
                raise RuntimeError("the browser has gone")
            self._buffer += chunk
        message, self._buffer = self._buffer.split(b"\0", 1)
        return json.loads(message)

    def call(self, method, session=None, **parameters):
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        begin = time.monotonic()
        while time.monotonic() - begin < TIMEOUT_S:
            answer = self._message()
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self.events.append(answer)
        raise RuntimeError(f"{method}: no answer")

    def wait_for(self, event):
        while True:
            for seen in self.events:
                if seen.get("method") == event:
                    return
            self.events.append(self._message())

    def close(self):
        self._process.kill()
        self._process.wait()
        os.close(self._out)
        os.close(self._in)


class Page:
    """A tab. complaints(): what went wrong in it since the last time, as sentences."""

    def __init__(self, browser):
        self._browser = browser
        target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Log", "Runtime", "Network", "DOM"):
            self.call(domain + ".enable")
        self.call("Emulation.setFocusEmulationEnabled", enabled=True)

    def call(self, method, **parameters):
        return self._browser.call(method, self.session, **parameters)

    def look(self, width, scheme, height=900):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)
        self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def open(self, url):
        self._browser.events = []
        self.call("Page.navigate", url=url)
        self._browser.wait_for("Page.loadEventFired")

    def value(self, expression):
        """Of an expression, which may be a promise."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise RuntimeError(expression[:80] + ": " + details.get("exception", {}).get("description", details["text"]))
        return answer["result"].get("value")

    def wait_until(self, expression, what, timeout_s=TIMEOUT_S):
        """Until an expression is true: what it is; waits in the page, for each change of it."""
        found = self.value(f"""new Promise(resolve => {{
          const begin = Date.now();
          const look = () => {{
            let seen = null;
            try {{ seen = ({expression}); }} catch {{ /* not there yet */ }}
            if (seen) return resolve(typeof seen === 'object' ? true : seen);
            if (Date.now() - begin > {timeout_s * 1000}) return resolve(null);
            setTimeout(look, 50);
          }};
          look();
        }})""")
        if not found:
            raise RuntimeError(f"waited in vain for {what}; the page says: " + str(self.value("document.body.innerText"))[:1500])
        return found

    def choose_files(self, selector, paths):
        root = self.call("DOM.getDocument")["root"]["nodeId"]
        node = self.call("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        self.call("DOM.setFileInputFiles", nodeId=node, files=paths)

    def screenshot(self, path):
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        shot = self.call("Page.captureScreenshot", captureBeyondViewport=True,
                         clip={"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1})
        with open(path, "wb") as file:
            file.write(base64.b64decode(shot["data"]))

    def complaints(self):
        events, self._browser.events = self._browser.events, []
        wrong = []
        for event in events:
            method, parameters = event.get("method"), event.get("params", {})
            if method == "Log.entryAdded":
                wrong.append("console: " + parameters["entry"]["text"][:300] + " " + parameters["entry"].get("url", ""))
            elif method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning"):
                wrong.append("console: " + str(parameters["args"])[:300])
            elif method == "Runtime.exceptionThrown":
                details = parameters["exceptionDetails"]
                wrong.append("exception: " + details.get("exception", {}).get("description", details["text"])[:300])
        return wrong
