#!/usr/bin/env python3
"""Runs bake_sets.py with stand-ins for the programs that it starts."""

import csv
import json
import os
import stat
import subprocess
import sys
import tempfile
import unittest

SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "bake_sets.py")

PATINA = r'''
import json, os, sys
arguments = sys.argv[1:]
option = lambda name: arguments[arguments.index(name) + 1] if name in arguments else None
asset = os.path.basename(arguments[1])
with open(os.environ["CALLS"], "a") as calls:
    calls.write(" ".join(arguments[1:]) + "\n")
if asset == "broken":
    print(json.dumps({"asset": asset, "status": "failed", "error": {"code": "corrupt_data", "message": "no maps"}}))
    sys.exit(3)
paper = option("--recipe") == "paper"
quality = (30.0 if paper else 33.0) + int(option("--seed"))

def bake(asset):
    container = os.path.join(option("--out"), asset)
    os.makedirs(container, exist_ok=True)
    with open(os.path.join(container, "report.json"), "w") as file:
        json.dump({"width": 64, "height": 32, "channels": [{}, {}, {"constant": 1}],
                   "training": {"export": {"float_model_psnr_db": {"mip0": 31.5, "mean_mips": 35.0, "off_grid": 29.0},
                                           "exported_psnr_db": {"mip0": 31.25, "mean_mips": 34.0, "off_grid": 28.5}}}}, file)
    with open(os.path.join(container, "run.json"), "w") as file:
        json.dump({"samples_per_s": 2.5e7, "peak_memory_bytes": 1000}, file)
    return {"asset": asset, "status": "done", "container": container, "bytes": 1770000, "seconds": 20.0,
            "cpu_seconds": 39.0, "samples": int(option("--samples") or 4000), "stopped_by": "budget", "ssim": 0.9,
            "flip": None, "normal_angle_deg": 3.5,
            "psnr": {"overall": quality, "mip0": quality - 1, "mean_mips": quality + 2, "maps": {}}}

print("progress that is not JSON")
if asset == "pair":
    print(json.dumps({"version": 1, "exit_code": 0, "assets": [bake("pair_left"), bake("pair_right")]}))
else:
    print(json.dumps(bake(asset)))
'''

PEERS = r'''
import json, os, sys
asset = os.path.basename(sys.argv[1])
size = int(sys.argv[sys.argv.index("--bytes") + 1])
for codec, nearest, size in (("BC1 + BC5", False, 4 * size), ("ASTC 12x12", True, size)):
    print(json.dumps({"set": asset, "width": 64, "height": 32, "channels": 2, "codec": codec, "nearest": nearest,
                      "bytes": size, "seconds": 1.0, "psnr": {"overall": 29.0, "mip0": 28.0, "mean_mips": 33.0},
                      "ssim": 0.8, "normal_angle_deg": 5.0}))
'''


class BakeSetsTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.patina, self.peers = self.program("patina", PATINA), self.program("peers", PEERS)
        self.calls = self.path("calls.txt")
        for name in ("brick", "stone", "broken"):
            os.makedirs(self.path("sets", name))
            open(self.path("sets", name, "x_color.PNG"), "w", encoding="utf-8").close()
        os.makedirs(self.path("sets", "no_images"))

    def path(self, *parts):
        return os.path.join(self.folder.name, *parts)

    def program(self, name, text):
        path = self.path(name)
        with open(path, "w", encoding="utf-8") as file:
            file.write(f"#!{sys.executable}\n{text}")
        os.chmod(path, os.stat(path).st_mode | stat.S_IXUSR)
        return path

    def run_script(self, *arguments, peers=None):
        command = [sys.executable, "-B", SCRIPT, "--sets", self.path("sets"), "--out", self.path("out"),
                   "--patina", self.patina, "--peers", peers or self.peers, "--seeds", "1,2", *arguments]
        return subprocess.run(command, env={**os.environ, "CALLS": self.calls}, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, text=True, check=False)

    def read(self, *parts):
        with open(self.path(*parts), encoding="utf-8") as file:
            return file.read()

    def test_bakes_all_sets_and_compares_at_equal_samples(self):
        done = self.run_script()
        self.assertEqual(done.returncode, 1, done.stderr)  # one set is broken
        calls = self.read("calls.txt").splitlines()
        self.assertEqual(sum(" --recipe paper" in call for call in calls), 4)  # two sets, two seeds; none of the broken one
        self.assertTrue(all("--samples 4000" in call for call in calls if " --recipe paper" in call))
        self.assertFalse(any("--samples" in call for call in calls if " --recipe patina" in call))
        self.assertFalse(any("no_images" in call for call in calls))

        table = self.read("out", "table.md")
        self.assertIn("| brick | 64×32 | 2 | bcf-1k | standard | patina | 1.77 | 20.0 | 25.0 | 34.50 | 33.50 | 36.50 | 0.25 "
                      "| 1.00 | 0.50 | 0.9000 |  | 3.50 |", table)
        self.assertIn("| **mean of 2 sets** |  |  | bcf-1k | standard | paper |", table)
        self.assertIn("| **least** | bcf-1k | standard | patina − paper | +3.00 | +3.00 | +3.00 |", table)
        self.assertIn("| stone | BC1 + BC5 | 7.08 |", table)
        self.assertIn("| **mean of 2 sets** | ASTC, nearest size | 1.77 |", table)
        self.assertIn("- broken: no maps", table)

        with open(self.path("out", "table.csv"), encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), 2 * 4 + 2 * 2 + 2)
        self.assertEqual({row["codec"] for row in rows}, {"patina", "BC1 + BC5", "ASTC 12x12"})
        self.assertEqual([row["lost_mip0"] for row in rows if row["codec"] == "patina" and row["set"] == "brick"],
                         ["0.25"] * 4)

    def test_takes_every_material_of_a_folder_that_holds_several(self):
        os.makedirs(self.path("sets", "pair"))
        open(self.path("sets", "pair", "x_color.png"), "w", encoding="utf-8").close()
        done = self.run_script("--only", "pair", peers="none")
        self.assertEqual(done.returncode, 0, done.stderr)
        table = self.read("out", "table.md")
        for asset in ("pair_left", "pair_right"):
            self.assertIn(f"| {asset} | 64×32 | 2 | bcf-1k | standard | patina |", table)

    def test_goes_on_where_it_stopped(self):
        self.run_script("--only", "brick")
        first = self.read("calls.txt").count("\n")
        self.run_script("--only", "brick,stone")
        calls = self.read("calls.txt").splitlines()[first:]
        self.assertEqual(len(calls), 4)
        self.assertTrue(all("stone" in call for call in calls))

    def test_forgets_results_of_another_program(self):
        self.run_script("--only", "brick")
        first = self.read("calls.txt").count("\n")
        with open(self.patina, "a", encoding="utf-8") as file:
            file.write("# changed\n")
        self.run_script("--only", "brick")
        self.assertEqual(self.read("calls.txt").count("\n"), 2 * first)

    def test_survives_a_line_cut_short(self):
        self.run_script("--only", "brick")
        with open(self.path("out", "runs.jsonl"), "a", encoding="utf-8") as file:
            file.write('{"key": "half of a')
        self.run_script("--only", "brick,stone")
        calls = self.read("calls.txt")
        done = self.run_script("--only", "brick,stone")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.read("calls.txt"), calls)

    def test_writes_tables_without_peers(self):
        done = self.run_script("--only", "brick", peers="none")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("BC1", self.read("out", "table.md"))

    def test_names_a_program_that_is_not_there(self):
        done = self.run_script(peers=self.path("nothing"))
        self.assertEqual(done.returncode, 2)
        self.assertIn("nothing", done.stderr)

    def test_keeps_what_it_measured_as_json_lines(self):
        self.run_script("--only", "brick")
        for line in self.read("out", "runs.jsonl").splitlines():
            self.assertIn("rows", json.loads(line))


if __name__ == "__main__":
    unittest.main()
