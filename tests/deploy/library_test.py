#!/usr/bin/env python3
"""Installs the decoder and the formats library, builds deploy/examples against them with find_package, and runs them.

usage: library_test.py SOURCE PATINA BUILD COMPILER
"""

import glob
import json
import os
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

SOURCE, PATINA, BUILD = (os.path.abspath(path) for path in sys.argv[1:4])
COMPILER = sys.argv[4]


def run(*words, code=0, **more):
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False, **more)
    assert done.returncode == code, f"{' '.join(words)}: {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout if code == 0 else done.stderr


def single_pixel(path):
    """Channel values in [0, 1] of a PNG of 1 x 1 texels, 8 or 16 bit."""
    with open(path, "rb") as file:
        data = file.read()
    at, packed, depth = 8, b"", 0
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            width, height, depth = struct.unpack(">IIB", body[:9])
            assert (width, height) == (1, 1), (width, height)
        elif kind == b"IDAT":
            packed += body
        at += 12 + size
    # Every filter leaves the first texel as it is.
    raw = zlib.decompress(packed)[1:]
    return [value / 255 for value in raw] if depth == 8 else [value / 65535 for value in struct.unpack(f">{len(raw) // 2}H", raw)]


class Library(unittest.TestCase):
    @classmethod
    def place(cls, name):
        return os.path.join(cls.folder.name, name)

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        for component in ("decoder", "formats"):
            run("cmake", "--install", BUILD, "--component", component, "--prefix", cls.place("prefix"))
        run("cmake", "-G", "Ninja", "-S", os.path.join(SOURCE, "deploy", "examples"), "-B", cls.place("build"),
            "-DCMAKE_PREFIX_PATH=" + cls.place("prefix"), "-DCMAKE_CXX_COMPILER=" + COMPILER)
        run("cmake", "--build", cls.place("build"))
        run(PATINA, "sample", "--out", cls.place("sample"), "--size", "64", "-q")
        run(PATINA, "bake", cls.place("sample"), cls.place("sample/brdf/sparse.csv"), "--out", cls.place("baked"), "--quality",
            "preview", "--no-report", "-q")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def example(self, name, *arguments, code=0):
        return run(os.path.join(self.folder.name, "build", name), *arguments, code=code)

    def manifest(self, asset):
        with open(os.path.join(self.folder.name, "baked", asset, "current", "manifest.json"), encoding="utf-8") as file:
            return json.load(file)

    def test_decodes_what_unpack_writes(self):
        container = os.path.join(self.folder.name, "baked", "sample")
        values = {name: float(value) for name, value in
                  (line.split() for line in self.example("decode", container, "0.5", "0.5", "6").splitlines())}
        run(PATINA, "unpack", container, "--out", os.path.join(self.folder.name, "maps"), "--mip", "6", "-q")
        (roughness,) = [name for name in os.listdir(os.path.join(self.folder.name, "maps")) if "roughness" in name.lower()]
        pixel = single_pixel(os.path.join(self.folder.name, "maps", roughness))
        # Half a code of 8 bits, and a little for the rounding of what is printed.
        self.assertLess(abs(values["roughness"] - pixel[0]), 0.51 / 255)
        self.assertGreater(pixel[0], 0.01)
        channels = [c["map"] + ("." + c["component"] if c.get("component") else "") for c in self.manifest("sample")["channels"]]
        self.assertEqual(list(values), channels)

    def test_brdf_behind_a_path_tracers_interface(self):
        lines = self.example("path_tracer_material", os.path.join(self.folder.name, "baked", "sparse")).splitlines()[1:]
        self.assertEqual(len(lines), 3)
        for line in lines:
            degrees, sampled, weighted, pdf_ratio = (float(word) for word in line.split())
            self.assertGreater(weighted, 0.01, degrees)
            # Two estimates of one integral, from 20,000 points each; what they differ by is their noise.
            self.assertLess(abs(sampled - weighted), 0.03 * weighted, line)
            self.assertLess(pdf_ratio, 1.001, line)

    def test_formats_library_lists_and_checks(self):
        for asset in ("sample", "sparse"):
            lines = self.example("list_payloads", os.path.join(self.folder.name, "baked", asset)).splitlines()
            manifest = self.manifest(asset)
            self.assertEqual(lines[0], f"{asset}: {manifest['kind']}")
            listed = [f"{file['name']} {file['role']} {file['bytes']}" for file in manifest["payloads"]]
            self.assertEqual(lines[1:], listed)

    def test_what_is_wrong_is_said(self):
        self.assertIn("nothing/current/manifest.json", self.example("decode", os.path.join(self.folder.name, "nothing"), "0", "0", code=3))
        sparse = os.path.join(self.folder.name, "baked", "sparse")
        self.assertIn("/kind", self.example("decode", sparse, "0", "0", code=3))
        self.assertIn("list_payloads: error:", self.example("list_payloads", self.folder.name, code=3))

    def test_version_and_components_are_checked(self):
        for wanted, problem in (("99", "version"), ("0.1 COMPONENTS renderer", "renderer")):
            with tempfile.TemporaryDirectory() as folder:
                with open(os.path.join(folder, "CMakeLists.txt"), "w", encoding="utf-8") as file:
                    file.write("cmake_minimum_required(VERSION 3.20)\nproject(x LANGUAGES NONE)\n"
                               f"find_package(patina {wanted} REQUIRED)\n")
                (config,) = glob.glob(self.place("prefix/lib*/**/patina-config.cmake"), recursive=True)
                said = run("cmake", "-G", "Ninja", "-S", folder, "-B", folder + "/b", "-Dpatina_DIR=" + os.path.dirname(config),
                           code=1)
                self.assertIn(problem, said)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
