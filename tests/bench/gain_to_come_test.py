#!/usr/bin/env python3
"""Gains after a part of a training are read from the right points, once for each training."""
import json
import os
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import gain_to_come  # noqa: E402


class GainToCome(unittest.TestCase):
    def test_reads_each_training_once(self):
        curve = [(0, 10.0), (100, 20.0), (200, 22.0), (400, 25.0), (800, 27.0), (1600, 30.0)]
        manifest = {"fingerprint": "a", "tool": {"recipe": "patina"},
                    "training": {"stopped_by": "budget", "curve": [{"samples": s, "psnr_mip0_db": d} for s, d in curve]}}
        with tempfile.TemporaryDirectory() as folder:
            for name, text in (("one", json.dumps(manifest)), ("again", json.dumps(manifest)), ("broken", "{"),
                               ("early", json.dumps(manifest).replace("budget", "target").replace('"a"', '"b"'))):
                os.mkdir(os.path.join(folder, name))
                with open(os.path.join(folder, name, "manifest.json"), "w", encoding="utf-8") as file:
                    file.write(text)
            lines = gain_to_come.table([folder])
        self.assertEqual(lines[2], "| 1/16 | 1 | 10.00 dB | 10.00 dB | 8.60 dB | 1 |")
        self.assertEqual(lines[5], "| 1/2 | 1 | 3.00 dB | 3.00 dB | 2.90 dB | 1 |")

    def test_bound_is_the_trainers(self):
        with open(os.path.join(os.path.dirname(__file__), "..", "..", "pipeline", "material", "train.cpp"), encoding="utf-8") as file:
            self.assertIn("progress < 1 ? 1 + 1.9 * std::log2(1 / progress) : 0", file.read())


if __name__ == "__main__":
    unittest.main()
