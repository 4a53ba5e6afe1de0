#!/usr/bin/env python3
"""Runs nbrdf_networks.py on small archives."""

import os
import struct
import subprocess
import sys
import tempfile
import unittest
import zipfile

SCRIPT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "nbrdf_networks.py")
SHAPES = {"k0": (6, 21), "b0": (21,), "k1": (21, 21), "b1": (21,), "k2": (21, 3), "b2": (3,)}


def array(numbers, shape, kind="<f4"):
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + struct.pack(f"<{len(numbers)}f", *numbers)


class NbrdfNetworks(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.archive = os.path.join(self.folder.name, "in.npz")
        self.text = os.path.join(self.folder.name, "out.txt")

    def write(self, arrays, compression=zipfile.ZIP_DEFLATED):
        with zipfile.ZipFile(self.archive, "w", compression) as archive:
            for name, data in arrays.items():
                archive.writestr(name + ".npy", data)

    def network(self, material, first=0.0):
        arrays = {}
        for name, shape in SHAPES.items():
            count = shape[0] * (shape[1] if len(shape) > 1 else 1)
            arrays[f"{material}/{name}"] = array([first + i for i in range(count)], shape)
            first += count
        return arrays

    def run_script(self):
        return subprocess.run([sys.executable, "-B", SCRIPT, self.archive, self.text], capture_output=True, text=True)

    def test_writes_a_line_of_675_numbers_for_each_material_in_order_of_names(self):
        for compression in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            self.write({**self.network("steel", 1000.5), **self.network("brass")}, compression)
            self.assertEqual(self.run_script().returncode, 0)
            with open(self.text, encoding="utf-8") as text:
                lines = [line.split() for line in text]
            self.assertEqual([line[0] for line in lines], ["brass", "steel"])
            self.assertEqual([float(word) for word in lines[0][1:]], list(range(675)))
            self.assertEqual([float(word) for word in lines[1][1:]], [1000.5 + i for i in range(675)])

    def test_refuses_what_is_missing_or_has_another_shape_or_type(self):
        arrays = self.network("steel")
        for change in ({"steel/k1": None}, {"steel/b2": array([1, 2], (2,))}, {"steel/b2": array([1, 2, 3], (3,), ">f4")},
                       {"steel/b2": array([1, 2], (3,))}, {"steel/b2": b"no array"}):
            changed = {name: data for name, data in {**arrays, **change}.items() if data is not None}
            self.write(changed)
            result = self.run_script()
            self.assertEqual(result.returncode, 1, change)
            self.assertIn(next(iter(change)), result.stderr)
            self.assertFalse(os.path.exists(self.text))

    def test_refuses_what_is_no_archive(self):
        with open(self.archive, "wb") as file:
            file.write(b"plain")
        self.assertEqual(self.run_script().returncode, 1)


if __name__ == "__main__":
    unittest.main()
