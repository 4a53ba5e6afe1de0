#!/usr/bin/env python3
"""Looks at baked containers in the viewer, in Chromium with WebGL 2 by SwiftShader, served by `patina view`.

usage: viewer_browser_test.py PATINA DECODER_VALUES FOLDER [--quick]

Bakes small samples: a material, one whose textures WebGL does not take as blocks, one of a scene with constant channels,
a measured BRDF, and one that varies over a surface. Holds the values that the page reads back from its shader against those of the C++ decoder, and the
pixels of a single channel against what they stand for; looks at all with our checks of accessibility and those of
axe-core, on a wide screen and on a phone, in the light and in the dark; takes the context away and gives it back;
damages a file. Fails on an error in the browser's console. Leaves a screenshot of each view in FOLDER, which is made
anew. With --quick only values, pixels and one look at the material of a scene. Exits with 77, saying so, without Chromium.
"""

import json
import math
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request

from chromium import SKIPPED, SOFTWARE_GL, Browser, Page, find_chromium
from page_checks import AXE_MISSING, faults_of, has_axe

WIDTHS = (1280, 390)
SCHEMES = ("light", "dark")
# Of the window while values are compared: the picture is drawn anew for each, every pixel on a core.
SMALL = (600, 420)
# Of a channel's range, as formats/ENGINE.md states it: the driver's pow against that of the C library.
BOUND = 1e-4
# Of log(1 + f): derived corners are rounded to halves, and angles are approximated.
BRDF_BOUND = 1e-3
# Codes of 8 bits: rounding, twice, and the display's curve.
PIXEL_BOUND = 2.0
PIXEL_MIP = 1
READY = "performance.getEntriesByName('patina-shown').length > 0"


class Viewer:
    """A `patina view` that runs."""

    def __init__(self, patina, container, *options):
        self._process = subprocess.Popen([patina, "view", container, "--no-browser", *options], stdin=subprocess.DEVNULL,
                                         stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.url = self._process.stdout.readline().strip()
        if not re.fullmatch(r"http://127\.0\.0\.1:[0-9]+/#token=[0-9a-f]{48}", self.url):
            raise RuntimeError(f"patina view says {self.url!r}: {self._process.communicate()[1]}")

    def status_of(self, path, token=None):
        request = urllib.request.Request(self.url.split("#")[0].rstrip("/") + path)
        if token is not None:
            request.add_header("Authorization", "Bearer " + token)
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return answer.status
        except urllib.error.HTTPError as error:
            return error.code

    def stop(self):
        """As Ctrl-C does; the exit code."""
        self._process.send_signal(signal.SIGINT)
        try:
            return self._process.wait(60)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return -1


def pick(page, name, value):
    """Uses one of the controls: a radio button, a check box, a range or a list."""
    page.value(f"""(() => {{
      const value = {json.dumps(value)}, name = {json.dumps(name)};
      const radio = document.querySelector(`input[type=radio][name=${{name}}][value="${{value}}"]`);
      if (radio) {{ radio.click(); return true; }}
      const other = document.querySelector(`#pick-${{name}}, #slide-${{name}}, #at-${{name}}, input[name=${{name}}], #${{name}}`);
      if (other.type === 'checkbox') {{ if (other.checked !== value) other.click(); return true; }}
      other.value = value;
      other.dispatchEvent(new Event('input', {{bubbles: true}}));
      other.dispatchEvent(new Event('change', {{bubbles: true}}));
      return true;
    }})()""")


def drawn(page):
    page.value("new Promise(resolve => requestAnimationFrame(() => requestAnimationFrame(() => resolve(true))))")


def pixels(page, points):
    """Colours [r, g, b] of the picture at places in it, each a pair of fractions of its width and height."""
    drawn(page)
    box = page.value("(() => { const {x, y, width, height} = document.getElementById('view').getBoundingClientRect();"
                     "return {x: x + scrollX, y: y + scrollY, width, height}; })()")
    shot = page.call("Page.captureScreenshot", clip={**box, "scale": 1})["data"]
    colors = page.value(f"""(async () => {{
      const bytes = Uint8Array.from(atob({json.dumps(shot)}), letter => letter.charCodeAt(0));
      const image = await createImageBitmap(new Blob([bytes]), {{colorSpaceConversion: 'none'}});
      const context = new OffscreenCanvas(image.width, image.height).getContext('2d', {{willReadFrequently: true}});
      context.drawImage(image, 0, 0);
      return {json.dumps(points)}.map(([x, y]) =>
        [...context.getImageData(Math.floor(x * image.width), Math.floor(y * image.height), 1, 1).data].slice(0, 3));
    }})()""")
    return colors, box


ALL_VIEWS = tuple((width, scheme) for width in WIDTHS for scheme in SCHEMES)
ONE_EACH = ((WIDTHS[0], SCHEMES[1]), (WIDTHS[1], SCHEMES[0]))


def look(page, name, folder, wrong, views=ONE_EACH):
    for width, scheme in views:
        page.look(width, scheme)
        drawn(page)
        view = f"{name}, {width} pixels, {scheme}"
        wrong.extend(f"{view}: {text}" for text in faults_of(page))
        wrong.extend(f"{view}: {text}" for text in page.complaints())
        page.screenshot(os.path.join(folder, f"{name}-{width}-{scheme}.png"))
    page.look(SMALL[0], SCHEMES[0], SMALL[1])


def show(page, viewer):
    page.open(viewer.url)
    page.wait_until(READY + " || document.querySelector('#trouble [role=alert]')", "the viewer")
    trouble = page.value("document.getElementById('trouble').textContent")
    if trouble:
        raise RuntimeError("the viewer says: " + trouble)


def read_values(page):
    return page.value("[...document.querySelectorAll('#values tbody tr')].map(row => "
                      "[...row.querySelectorAll('data')].map(cell => Number(cell.value)))")


def expected_values(decoder_values, container, places):
    text = "".join(" ".join(str(number) for number in place) + "\n" for place in places)
    made = subprocess.run([decoder_values, container], input=text, capture_output=True, text=True, check=True)
    return [[float(value) for value in line.split()] for line in made.stdout.splitlines()]


def manifest_of(container):
    with open(os.path.join(container, "current", "manifest.json"), encoding="utf-8") as file:
        return json.load(file)


def physical(channel, coded):
    scale = channel.get("scale", 1)
    if channel["encoding"] == "srgb":
        return coded / 12.92 if coded <= 0.04045 else ((coded + 0.055) / 1.055) ** 2.4
    if channel["encoding"] == "signed_log":
        return math.copysign(scale * (2 ** abs(coded) - 1), coded)
    return 2 * coded - 1 if channel["encoding"] == "normal_xy" else coded * scale


def range_of(channel):
    """Of physical values; of a constant, which is a number in the shader, its size."""
    if "constant" in channel:
        return max(abs(physical(channel, channel["constant"])), 1e-3)
    return physical(channel, channel["range"][1]) - physical(channel, channel["range"][0])


def check_values(page, decoder_values, container, name, wrong):
    manifest = manifest_of(container)
    source = manifest["source"]
    rng = random.Random(7)
    # Texel centres of several mips, and places between texels and between mips.
    places = []
    for mip in (0, 1, source["levels"] - 1):
        width, height = max(1, source["width"] >> mip), max(1, source["height"] >> mip)
        places += [((rng.randrange(width) + 0.5) / width, (rng.randrange(height) + 0.5) / height, mip) for _ in range(2)]
    places += [(rng.uniform(0, 1), rng.uniform(0, 1), rng.uniform(0, source["levels"] - 1)) for _ in range(4)]
    # The page reads them as float32: so do we, to ask for the very same place.
    places = [tuple(round(value * 4096) / 4096 for value in place) for place in places]
    worst = 0
    for place, expected in zip(places, expected_values(decoder_values, container, places)):
        page.value(f"""(() => {{
          const fields = ['u', 'v', 'level'].map(name => document.getElementById('at-' + name)), place = {json.dumps(place)};
          fields.forEach((field, i) => {{ field.value = place[i]; }});
          fields.forEach(field => field.dispatchEvent(new Event('change')));
          return true;
        }})()""")
        read = [row[0] for row in read_values(page)]
        if len(read) != len(expected):
            wrong.append(f"{name}: {len(read)} channels are read back, there are {len(expected)}")
            return
        for channel, got, want in zip(manifest["channels"], read, expected):
            error = abs(got - want) / range_of(channel)
            worst = max(worst, error)
            if not error <= BOUND:
                wrong.append(f"{name}: {channel['map']}.{channel['component']} at {place} is {got}, the decoder has {want}")
    print(f"{name}: {len(places)} places x {len(manifest['channels'])} channels, largest error {worst:.2e} of the range (bound {BOUND:g})")


def check_pixels(page, decoder_values, container, name, wrong):
    """The picture of a single channel, on the plane, at one mip."""
    manifest = manifest_of(container)
    index = next(i for i, channel in enumerate(manifest["channels"]) if "output" in channel and channel["encoding"] == "srgb")
    for control, value in (("full", True), ("shape", "plane"), ("show", f"channel:{index}"), ("mip", PIXEL_MIP)):
        pick(page, control, value)
    points = [(0.5 + x / 10, 0.5 + y / 10) for x, y in ((-1, -1), (1.5, 0.5), (0, 1), (-1.25, 0.75))]
    colors, box = pixels(page, points)
    # The plane reaches from -1 to 1, of which the shorter side of the picture shows 1 / 0.9 each way.
    side = min(box["width"], box["height"])

    def place(x, y, right, below):
        across = (int(x * box["width"]) + 0.5 + right - box["width"] / 2) / (side / 2) / 0.9
        down = (int(y * box["height"]) + 0.5 + below - box["height"] / 2) / (side / 2) / 0.9
        return (across + 1) / 2, (down + 1) / 2, PIXEL_MIP

    # The picture may lie between the pixels of the screen: what it shows is between the values a pixel around.
    around = [(right, below) for right in (-1, 0, 1) for below in (-1, 0, 1)]
    expected = expected_values(decoder_values, container, [place(x, y, *step) for x, y in points for step in around])
    for i, (point, color) in enumerate(zip(points, colors)):
        codes = []
        for values in expected[9 * i:9 * i + 9]:
            value = min(max(values[index], 0), 1)
            codes.append(255 * (12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055))
        if max(color) > max(codes) + PIXEL_BOUND or min(color) < min(codes) - PIXEL_BOUND:
            wrong.append(f"{name}: the picture of channel {index} at {place(*point, 0, 0)} is {color}, it stands for {codes[4]:.1f}")
    for control, value in (("shape", "sphere"), ("show", "lit"), ("mip", -1), ("full", False)):
        pick(page, control, value)


def pairs_of_angles(page, count):
    """Pairs of angles in degrees, and for each the directions as the page takes them, as text."""
    rng = random.Random(3)
    pairs = [(rng.randrange(-85, 86), rng.randrange(-85, 86)) for _ in range(count)]
    # sin and cos of whole degrees.
    return pairs, [page.value(f"[{light}, {view}].map(d => `${{Math.fround(Math.sin(d * Math.PI / 180))}},0,"
                              "${Math.fround(Math.cos(d * Math.PI / 180))}`).join(',')") for light, view in pairs]


def check_f(page, name, pairs, expected, wrong):
    """What the page reads back of f at pairs of angles."""
    worst = 0
    log1p = lambda value: math.log1p(max(value, 0))
    span = max(log1p(value) for line in expected for value in line) or 1
    for (light, view), want in zip(pairs, expected):
        pick(page, "incoming", light)
        pick(page, "outgoing", view)
        got = [row[0] for row in read_values(page)]
        for a, b in zip(got, want):
            error = abs(log1p(a) - log1p(b)) / max(span, 1)
            worst = max(worst, error)
            if not error <= BRDF_BOUND:
                wrong.append(f"{name}: f from {light} to {view} degrees is {got}, the decoder has {want}")
                break
    print(f"{name}: {len(pairs)} pairs of directions, largest error {worst:.2e} of log(1 + f) (bound {BRDF_BOUND:g})")


def check_brdf(page, patina, container, scratch, wrong):
    pairs, directions = pairs_of_angles(page, 12)
    with open(os.path.join(scratch, "pairs.csv"), "w", encoding="utf-8") as file:
        file.write("".join(line + "\n" for line in directions))
    made = subprocess.run([patina, "eval", container, "--pairs", file.name], capture_output=True, text=True, check=True)
    check_f(page, "brdf", pairs, [[float(value) for value in line.split(",")] for line in made.stdout.splitlines()], wrong)


def check_varying(page, decoder_values, container, wrong):
    """f of a BRDF that varies, at places between texels and mips."""
    pairs, directions = pairs_of_angles(page, 6)
    for place in ((0.5, 0.5, 0), (0.28125, 0.71875, 1), (0.90625, 0.125, 1.5)):
        for name, value in zip(("u", "v", "level"), place):
            pick(page, name, value)
        places = [(*place, *line.split(",")) for line in directions]
        check_f(page, f"varying at {place}", pairs, expected_values(decoder_values, container, places), wrong)


def check_bc6h(page, wrong):
    """The page's own decoder against the browser's, on random blocks, bit by bit."""
    found = page.value("""(async () => {
      const {decodeLevel} = await import('/web/view_bc6h.js');
      const canvas = document.createElement('canvas');
      const gl = canvas.getContext('webgl2');
      const bptc = gl.getExtension('EXT_texture_compression_bptc');
      if (!bptc || !gl.getExtension('EXT_color_buffer_float')) return 'no BC6H in this browser';
      const side = 512;
      const make = (kind, text) => { const s = gl.createShader(kind); gl.shaderSource(s, text); gl.compileShader(s); return s; };
      const program = gl.createProgram();
      gl.attachShader(program, make(gl.VERTEX_SHADER, '#version 300 es\\nvoid main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }'));
      gl.attachShader(program, make(gl.FRAGMENT_SHADER, '#version 300 es\\nprecision highp float; uniform highp sampler2D t; out vec4 o; void main() { o = texelFetch(t, ivec2(gl_FragCoord.xy), 0); }'));
      gl.linkProgram(program);
      const bytes = new Uint8Array(side * side);
      let seed = 12345;
      for (let i = 0; i < bytes.length; ++i) { seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0; bytes[i] = seed >>> 24; }
      const float = half => { const e = half >> 10 & 31, m = half & 1023, s = half & 0x8000 ? -1 : 1;
        return e === 0 ? s * m * 2 ** -24 : e === 31 ? (m ? NaN : s * Infinity) : s * (1 + m / 1024) * 2 ** (e - 15); };
      const result = [];
      for (const isSigned of [false, true]) {
        const format = isSigned ? bptc.COMPRESSED_RGB_BPTC_SIGNED_FLOAT_EXT : bptc.COMPRESSED_RGB_BPTC_UNSIGNED_FLOAT_EXT;
        const from = gl.createTexture(), to = gl.createTexture(), frame = gl.createFramebuffer();
        gl.bindTexture(gl.TEXTURE_2D, to);
        gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, side, side);
        gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, to, 0);
        gl.bindTexture(gl.TEXTURE_2D, from);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
        gl.texStorage2D(gl.TEXTURE_2D, 1, format, side, side);
        gl.compressedTexSubImage2D(gl.TEXTURE_2D, 0, 0, 0, side, side, format, bytes);
        gl.viewport(0, 0, side, side);
        gl.useProgram(program);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
        const read = new Float32Array(side * side * 4);
        gl.readPixels(0, 0, side, side, gl.RGBA, gl.FLOAT, read);
        const halves = decodeLevel(bytes, side, side, isSigned);
        let different = 0, first = '';
        for (let i = 0; i < read.length; ++i) {
          const own = float(halves[i]);
          if (i % 4 === 3 || own === read[i] || !Number.isFinite(own)) continue;
          if (different++ === 0) first = `texel ${(i >> 2) % side}, ${Math.floor((i >> 2) / side)}: ${own} for ${read[i]}`;
        }
        result.push(different === 0 ? '' : `${different} values differ (${isSigned ? 'signed' : 'unsigned'}), first ${first}`);
      }
      return result.filter(text => text).join('; ');
    })()""")
    if found:
        wrong.append("BC6H by the page: " + found)
    else:
        print("BC6H by the page: 32768 random blocks, the browser's bits")


def check_use(page, folder, wrong):
    """Wipe, difference, keyboard, cost, and the loss of the context."""
    pick(page, "compare", "wipe")
    look(page, "material-wipe", folder, wrong)
    pick(page, "compare", "difference")
    drawn(page)
    page.screenshot(os.path.join(folder, "material-difference.png"))
    pick(page, "compare", "decoded")
    for shape in ("plane", "cube"):
        pick(page, "shape", shape)
        drawn(page)
        page.screenshot(os.path.join(folder, f"material-{shape}.png"))
    pick(page, "shape", "sphere")

    middle = [(0.5, 0.35), (0.35, 0.5), (0.62, 0.6)]
    before, _ = pixels(page, middle)
    page.value("document.getElementById('view').focus(); true")
    for key, code, modifiers in (("ArrowRight", 39, 0), ("ArrowDown", 40, 0), ("ArrowLeft", 37, 8), ("+", 187, 0)):
        for _ in range(5):
            for kind in ("keyDown", "keyUp"):
                page.call("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code, modifiers=modifiers)
    after, _ = pixels(page, middle)
    if before == after:
        wrong.append("the keys change nothing in the picture")
    page.call("Input.dispatchKeyEvent", type="keyDown", key="0", code="Digit0", windowsVirtualKeyCode=48)
    again, _ = pixels(page, middle)
    if again != before:
        wrong.append(f"0 does not set all back: {before}, then {again}")

    page.value("document.getElementById('measure').click(); true")
    milliseconds = page.wait_until("document.getElementById('cost').dataset.ms", "the cost of a frame")
    print(f"a frame of 512 x 512 in SwiftShader: {float(milliseconds):.1f} ms (not gated)")

    page.value("window.taken = document.getElementById('view').getContext('webgl2').getExtension('WEBGL_lose_context');"
               "taken.loseContext(); true")
    page.wait_until("document.querySelector('#trouble [role=alert]')", "word that the picture is gone")
    page.complaints()  # the browser itself reports the loss
    page.value("taken.restoreContext(); true")
    page.wait_until("!document.querySelector('#trouble [role=alert]') && document.querySelector('#status.up')", "the picture again")
    restored, _ = pixels(page, middle)
    if restored != before:
        wrong.append(f"after the context came back the picture is {restored}, it was {before}")
    wrong.extend(page.complaints())


def check_server(viewer, wrong):
    token = viewer.url.split("=")[1]
    for path, given, status in (("/", None, 200), ("/web/viewer.js", None, 200), ("/web/app.js", token, 404),
                                ("/v1/container/files/manifest.json", None, 401), ("/v1/container/files/manifest.json", token[:-1] + "x", 401),
                                ("/v1/container/files/manifest.json", token, 200), ("/v1/container/files/run.json", token, 404),
                                ("/v1/container/files/..%2Fmanifest.json", token, 404), ("/v1/container/shader/material.glsl", token, 200)):
        seen = viewer.status_of(path, given)
        if seen != status:
            wrong.append(f"{path} answers {seen}, not {status}")


def bake(patina, scratch, is_quick):
    """Containers by name, and the maps of the first."""
    run = lambda *arguments: subprocess.run([patina, *arguments, "-q"], check=True, stdout=subprocess.DEVNULL)
    at = lambda name: os.path.join(scratch, name)
    common = ["--quality", "preview", "--no-report", "--out", at("baked")]
    run("sample", "--kind", "scene", "--out", at("scene"), "--size", "64")
    run("bake", at("scene/mosaic.gltf"), "--material", "wet floor", *common)
    if is_quick:
        return {"scene": os.path.join(at("baked"), "mosaic_wet_floor")}, None
    run("sample", "--kind", "all", "--out", at("wall"), "--size", "64")
    run("sample", "--kind", "material", "--out", at("odd"), "--size", "36")
    brdf = sorted(name for name in os.listdir(at("wall/brdf")) if name.endswith((".bsdf", ".csv", ".binary", ".json")))[0]
    maps = at("maps")
    os.makedirs(maps)
    for name in os.listdir(at("wall")):
        if name.endswith((".png", ".exr")):
            shutil.copy(os.path.join(at("wall"), name), maps)
    run("bake", maps, *common)
    run("bake", at("odd"), *common)
    run("bake", os.path.join(at("wall/brdf"), brdf), *common)
    run("sample", "--kind", "btf", "--out", at("btf"), "--size", "16")
    run("bake", at("btf"), *common)
    run("bake", at("btf"), *common[:-1], at("halves"), "--texture-format", "fp16")
    names = {"material": "maps", "scene": "mosaic_wet_floor", "odd": "odd", "brdf": brdf.split(".")[0], "varying": "bumps"}
    containers = {kind: os.path.join(at("baked"), name) for kind, name in names.items()}
    containers["varying-halves"] = os.path.join(at("halves"), "bumps")
    return containers, maps


def use(page, patina, decoder_values, scratch, folder, is_quick):
    """Everything that is wrong, as sentences."""
    wrong = []
    containers, maps = bake(patina, scratch, is_quick)
    page.look(SMALL[0], SCHEMES[0], SMALL[1])
    for name, container in containers.items():
        viewer = Viewer(patina, container, *(["--source", maps] if name == "material" else []))
        try:
            show(page, viewer)
            if "token" in page.value("location.href"):
                wrong.append(f"{name}: the token stays in the address")
            note = page.value("document.getElementById('under').textContent")
            if ("decoded by this page" in note) != (name == "odd"):
                wrong.append(f"{name}: says {note!r} of how textures are decoded")
            look(page, name, folder, wrong, ALL_VIEWS if name == "material" else ONE_EACH[:1] if is_quick else ONE_EACH)
            if name == "brdf":
                check_brdf(page, patina, container, scratch, wrong)
                pick(page, "shape", "lobe")
                look(page, "brdf-lobe", folder, wrong)
            elif name.startswith("varying"):
                check_varying(page, decoder_values, container, wrong)
                pick(page, "shape", "lobe")
                drawn(page)
                page.screenshot(os.path.join(folder, f"{name}-lobe.png"))
            else:
                check_values(page, decoder_values, container, name, wrong)
                check_pixels(page, decoder_values, container, name, wrong)
            if name == "material":
                check_use(page, folder, wrong)
                check_server(viewer, wrong)
                check_bc6h(page, wrong)
            wrong.extend(f"{name}: {text}" for text in page.complaints())
        finally:
            code = viewer.stop()
        if code != 0:
            wrong.append(f"{name}: patina view ends with {code} after Ctrl-C")

    if is_quick:
        return wrong

    # A damaged file: said when it starts, and on the page when it happens later.
    damaged = os.path.join(containers["odd"], "current", "features_1.dds")
    viewer = Viewer(patina, containers["odd"])
    try:
        with open(damaged, "r+b") as file:
            file.seek(160)
            byte = file.read(1)
            file.seek(160)
            file.write(bytes([byte[0] ^ 0x40]))
        page.open(viewer.url)
        page.wait_until("document.querySelector('#trouble [role=alert]')", "word of the damaged file")
        text = page.value("document.getElementById('trouble').textContent")
        if "features_1.dds" not in text:
            wrong.append(f"of a damaged file the page says {text!r}")
        page.complaints()  # the browser reports the answer of 500 by itself
    finally:
        viewer.stop()
    refused = subprocess.run([patina, "view", containers["odd"], "--no-browser"], capture_output=True, text=True, timeout=60)
    if refused.returncode != 3 or "features_1.dds" not in refused.stderr:
        wrong.append(f"patina view of a damaged container: {refused.returncode}, {refused.stderr!r}")

    # Without WebGL 2, and with a wrong token.
    viewer = Viewer(patina, containers["material"])
    try:
        without = page.call("Page.addScriptToEvaluateOnNewDocument", source="""{
          const own = HTMLCanvasElement.prototype.getContext;
          HTMLCanvasElement.prototype.getContext = function(kind, ...rest) { return kind === 'webgl2' ? null : own.call(this, kind, ...rest); };
        }""")["identifier"]
        page.open(viewer.url)
        page.wait_until("document.querySelector('#trouble [role=alert]') && document.querySelector('#preview canvas')", "word that WebGL 2 is missing")
        if "WebGL 2" not in page.value("document.getElementById('trouble').textContent"):
            wrong.append("the page does not say that WebGL 2 is missing")
        look(page, "no-webgl", folder, wrong)
        page.call("Page.removeScriptToEvaluateOnNewDocument", identifier=without)
        page.value("sessionStorage.clear(); true")
        page.open(viewer.url.split("#")[0])
        page.wait_until("document.getElementById('ask').open", "the question for the token")
    finally:
        viewer.stop()
    return wrong


def main():
    if len(sys.argv) not in (4, 5) or sys.argv[4:] not in ([], ["--quick"]):
        print(__doc__.strip(), file=sys.stderr)
        return 2
    patina, decoder_values, folder = (os.path.abspath(path) for path in sys.argv[1:4])
    program = find_chromium()
    if not program:
        print("SKIPPED: no Chromium here (apt install chromium): nobody has looked at the viewer")
        return SKIPPED
    if not has_axe():
        print(AXE_MISSING)
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        browser = Browser(program, os.path.join(scratch, "profile"), SOFTWARE_GL)
        try:
            wrong = use(Page(browser), patina, decoder_values, scratch, folder, len(sys.argv) == 5)
        finally:
            browser.close()
    for text in wrong:
        print("WRONG: " + text, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
