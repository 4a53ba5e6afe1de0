#!/usr/bin/env python3
"""Bakes small samples and reads their report pages as strictly as XML is read.

usage: report_page_test.py PATINA FOLDER

FOLDER is made anew; the pages stay in it, for report_browser_test.py.
"""

import base64
import json
import os
import re
import shutil
import struct
import subprocess
import sys
import unittest
import xml.etree.ElementTree
import zlib

PATINA = FOLDER = ""
HOSTILE = "<img src=x onerror='alert(1)'>&\"\u202egnp \x01" + "long" * 30 + ".png"


def patina(*arguments):
    return subprocess.run([PATINA, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)


def bake(test, *arguments, code=0):
    baked = patina("bake", *arguments, "--json", "--quality", "preview")
    test.assertEqual(baked.returncode, code, baked.stderr)
    return json.loads(baked.stdout.strip().splitlines()[-1])


def read(path):
    with open(path, "rb") as file:
        return file.read()


def keep(page, name):
    shutil.copyfile(page, os.path.join(FOLDER, name + ".html"))


def png_size(test, content):
    """Width and height of a PNG, every byte of which is looked at."""
    test.assertEqual(content[:8], b"\x89PNG\r\n\x1a\n")
    at, pixels, size = 8, b"", (0, 0)
    while at < len(content):
        length, kind = struct.unpack(">I4s", content[at:at + 8])
        body = content[at + 8:at + 8 + length]
        test.assertEqual(struct.unpack(">I", content[at + 8 + length:at + 12 + length])[0], zlib.crc32(kind + body))
        if kind == b"IHDR":
            size = struct.unpack(">II", body[:8])
            channels = {0: 1, 2: 3}[body[9]]
        if kind == b"IDAT":
            pixels += body
        at += 12 + length
    test.assertEqual(kind, b"IEND")
    test.assertEqual(len(zlib.decompress(pixels)), size[1] * (1 + channels * size[0]))
    return size


class ReportPage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(FOLDER, ignore_errors=True)
        os.makedirs(FOLDER)
        cls.out = os.path.join(FOLDER, "out")
        made = patina("sample", "--out", os.path.join(FOLDER, "samples"), "--size", "80", "--quiet")
        assert made.returncode == 0, made.stderr
        cls.maps = os.path.join(FOLDER, "samples")

    def check(self, path):
        """The root of a page that is well-formed, fetches nothing and whose pictures are whole."""
        content = read(path)
        root = xml.etree.ElementTree.fromstring(content)
        self.assertEqual(root.tag, "html")
        self.assertEqual(root.get("lang"), "en")
        text = content.decode("utf-8")
        self.assertLess(len(content), 3_000_000)
        for word in ("http:", "https:", "url(", "@import", "<script", "<link", "<iframe", "\x01"):
            self.assertNotIn(word, text)
        self.assertEqual(len(root.findall(".//h1")), 1)
        allowed = re.compile(r"^data:image/png;base64,[A-Za-z0-9+/]+=*$")
        for element in root.iter():
            for name, value in element.attrib.items():
                self.assertFalse(name.startswith("on"), name)
                if name in ("src", "href"):
                    self.assertRegex(value, allowed)
        images = root.findall(".//img")
        self.assertGreater(len(images), 0)
        for image in images:
            self.assertTrue(image.get("alt"))
            size = png_size(self, base64.b64decode(image.get("src").split(",")[1], validate=True))
            self.assertEqual(size, (int(image.get("width")), int(image.get("height"))))
        for table in root.findall(".//table"):
            self.assertTrue(table.find("caption").text)
            heads = len(table.findall("thead/tr/th"))
            for row in table.findall("tbody/tr"):
                self.assertEqual(len(row), heads)
                self.assertEqual(row[0].get("scope"), "row")
        for figure in root.findall(".//figure"):
            self.assertIsNotNone(figure.find("figcaption"))
        return root

    def words(self, root):
        return " ".join("".join(root.find("body").itertext()).split())

    def test_material_with_a_hostile_name(self):
        folder = os.path.join(FOLDER, "hostile")
        os.makedirs(folder)
        images = [name for name in os.listdir(self.maps) if name.endswith(".png")]
        for name in images:
            shutil.copyfile(os.path.join(self.maps, name), os.path.join(folder, name))
        shutil.copyfile(os.path.join(folder, images[0]), os.path.join(folder, HOSTILE))
        result = bake(self, folder, "--out", self.out, "--time-budget", "60", "--target-psnr", "20",
                      "--min-psnr", "5")
        page = os.path.join(result["container"], "report.html")
        root = self.check(page)
        keep(page, "material")
        words = self.words(root)
        self.assertIn("onerror='alert(1)'", words)
        self.assertIn(result["asset"], root.find(".//h1").text)
        self.assertIn(f"{result['psnr']['overall']:.1f} dB", words)
        for role in result["psnr"]["maps"]:
            self.assertIn(role, words)
        for word in ("time budget", "target for mip 0", "quality gate of 5.0 dB was met", "BC7", "sRGB", "Fingerprint",
                     "difference \u00d78", "normal.z", "features_0.dds"):
            self.assertIn(word, words)
        manifest = json.loads(read(os.path.join(result["container"], "manifest.json")))
        self.assertNotIn("report.html", [payload["name"] for payload in manifest["payloads"]])

    def test_rejected_and_none(self):
        kept = bake(self, self.maps, "--out", os.path.join(FOLDER, "gate"), "--min-psnr", "99", code=4)
        words = self.words(self.check(os.path.join(kept["container"], "report.html")))
        self.assertIn("Rejected by its quality gate", words)
        self.assertIn("quality gate of 99.0 dB was missed", words)
        # The page changes nothing else: but for the gate, the same comes out without it.
        none = bake(self, self.maps, "--out", os.path.join(FOLDER, "none"), "--no-report")
        self.assertEqual(kept["fingerprint"], none["fingerprint"])
        names = set(os.listdir(none["container"]))
        self.assertEqual(set(os.listdir(kept["container"])) - names, {"report.html"})
        for name in names - {"manifest.json", "run.json"}:
            self.assertEqual(read(os.path.join(none["container"], name)), read(os.path.join(kept["container"], name)))

    def test_constant(self):
        from_sample = os.path.join(FOLDER, "constant")
        os.makedirs(from_sample)
        header = struct.pack(">IIBBBBB", 16, 16, 8, 2, 0, 0, 0)
        rows = zlib.compress((b"\0" + b"\x40\x80\xc0" * 16) * 16)

        def chunk(kind, body):
            return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

        with open(os.path.join(from_sample, "flat_albedo.png"), "wb") as file:
            file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b""))
        result = bake(self, from_sample, "--out", self.out)
        content = read(os.path.join(result["container"], "report.html"))
        root = xml.etree.ElementTree.fromstring(content)
        words = self.words(root)
        self.assertIn("nothing had to be learned", words)
        self.assertIn("there is no curve", words)
        self.assertEqual(root.findall(".//img"), [])

    def check_brdf(self, result, pictures):
        page = os.path.join(result["container"], "report.html")
        root = self.check(page)
        keep(page, "brdf_" + result["asset"])
        words = self.words(root)
        for word in ("Neural BRDF", "lit sphere", "grid.hpx", "albedo", "reciprocity error", "codebook"):
            self.assertIn(word, words)
        self.assertEqual(len(root.findall(".//img")), pictures)

    def test_brdf_from_a_list(self):
        self.check_brdf(bake(self, os.path.join(self.maps, "brdf", "sparse.csv"), "--out", self.out), 1)

    def test_brdf_from_a_table(self):
        # A model of the least size, for time.
        job = {"version": 1, "kind": "brdf", "asset": "brushed", "out": self.out, "quality": "preview",
               "file": os.path.abspath(os.path.join(self.maps, "brdf", "brushed.bin")),
               "model": {"nside": 2, "hidden": 8, "hidden_layers": 1, "primitive_size": 4, "index_bits": 4}}
        path = os.path.join(FOLDER, "brushed.json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump(job, file)
        self.check_brdf(bake(self, path), 3)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        print(__doc__.strip(), file=sys.stderr)
        sys.exit(2)
    PATINA, FOLDER = sys.argv.pop(1), sys.argv.pop(1)
    unittest.main()
