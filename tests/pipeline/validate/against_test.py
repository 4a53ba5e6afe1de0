#!/usr/bin/env python3
"""`patina validate --against` and `--inputs` on a real bake: usage: against_test.py PATINA

Bakes a small sample, and then lies about it: about its quality, its gate and its source.
"""

import json
import os
import subprocess
import sys
import tempfile
import unittest

PATINA = os.path.abspath(sys.argv[1])


def patina(*arguments):
    return subprocess.run([PATINA, *arguments], capture_output=True, text=True, check=False)


class Against(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.source = os.path.join(cls.folder.name, "sample")
        cls.baked = os.path.join(cls.folder.name, "baked")
        for arguments in (["sample", "--kind", "material", "--size", "64", "--out", cls.source],
                          ["bake", cls.source, "--out", cls.baked, "--samples", "100000", "--min-psnr", "5"]):
            done = patina(*arguments)
            assert done.returncode == 0, done.stderr
        cls.manifest_path = os.path.join(cls.baked, "sample", "r0001", "manifest.json")
        with open(cls.manifest_path, encoding="utf-8") as file:
            cls.text = file.read()

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def tearDown(self):
        with open(self.manifest_path, "w", encoding="utf-8") as file:
            file.write(self.text)

    def codes(self, *options):
        done = patina("validate", self.baked, "--format", "json", *options)
        report = json.loads(done.stdout)
        self.assertEqual(done.returncode, 0 if report["valid"] else 1, done.stderr)
        self.assertNotIn(self.folder.name, done.stdout)
        return [finding["code"] for finding in report["findings"]]

    def lie(self, change):
        manifest = json.loads(self.text)
        change(manifest)
        with open(self.manifest_path, "w", encoding="utf-8") as file:
            json.dump(manifest, file)

    def test_what_was_baked_is_what_is_measured(self):
        self.assertEqual(self.codes("--against", self.source, "--inputs", self.source), [])

    def test_another_quality_is_found(self):
        def change(manifest):
            manifest["quality"]["psnr_db"]["mip0"] += 0.5
        self.lie(change)
        self.assertEqual(self.codes(), [])
        self.assertEqual(self.codes("--against", self.source), ["PAT-6101"])

    def test_another_source_is_found(self):
        def change(manifest):
            sha256 = manifest["source"]["files"][0]["sha256"]
            manifest["source"]["files"][0]["sha256"] = ("0" if sha256[0] != "0" else "1") + sha256[1:]
        self.lie(change)
        self.assertEqual(self.codes("--inputs", self.source), ["PAT-1401"])
        self.assertEqual(self.codes("--against", self.source), ["PAT-1401"])

    def test_a_gate_that_was_not_met_is_found(self):
        def change(manifest):
            manifest["quality"]["gate"] = {"min_psnr_db": 90, "met": False}
        self.lie(change)
        self.assertEqual(self.codes(), ["PAT-6001"])
        self.assertEqual(self.codes("--severity", "PAT-6001=off"), [])

    def test_usage_and_what_cannot_be_read_have_their_own_codes(self):
        self.assertEqual(patina("validate").returncode, 2)
        self.assertEqual(patina("validate", self.baked, "--severity", "PAT-1=off").returncode, 2)
        self.assertEqual(patina("validate", self.baked, "--format", "html").returncode, 2)
        self.assertEqual(patina("validate", os.path.join(self.baked, "none")).returncode, 3)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
