#!/usr/bin/env python3
"""The figure of a sweep: well-formed, escaped, fronts joined from left to right."""
import os
import sys
import unittest
import xml.dom.minidom

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import tradeoff_figure  # noqa: E402


def row(variant, quality, seconds, size, fronts):
    return {"kind": "material", "variant": variant, "inputs": 2, "quality_db": quality, "encode_s": seconds, "encode_cpu_s": 2 * seconds, "bytes": size,
            "decode_ns": 80.0, "fronts": fronts}


class Figure(unittest.TestCase):
    def test_is_well_formed_and_joins_the_front(self):
        rows = [row("large", 35, 20, 1860000, ["bytes"]), row("<small> & cheap", 28, 3, 118000, ["encode", "bytes"]),
                row("behind", 27, 9, 400000, [])]
        document = xml.dom.minidom.parseString(tradeoff_figure.figure({"means": rows}, "material"))
        titles = [t.firstChild.data for t in document.getElementsByTagName("title")]
        self.assertIn("<small> & cheap: 28.00 dB, 3.0 s, 118000 bytes, 80 ns", titles)
        lines = [p for p in document.getElementsByTagName("path") if p.getAttribute("class") == "l"]
        self.assertEqual(len(lines), 3)
        points = [part.split() for part in lines[1].getAttribute("d")[1:].split("L")]
        self.assertEqual(len(points), 2)
        self.assertLess(float(points[0][0]), float(points[1][0]))  # more bytes: to the right
        self.assertGreater(float(points[0][1]), float(points[1][1]))  # more quality: up
        circles = document.getElementsByTagName("circle")
        self.assertEqual(sum(c.getAttribute("class") == "o" for c in circles), 2 + 1 + 3)

    def test_finds_the_front_of_processor_seconds(self):
        rows = [row("large", 35, 20, 1, []), row("small", 28, 3, 1, []), row("behind", 27, 9, 1, []), row("twin", 28, 3, 1, [])]
        fronts = [entry["fronts"] for entry in tradeoff_figure.with_front(rows, "encode_cpu_s", "cpu")]
        self.assertEqual(fronts, [["cpu"], ["cpu"], [], ["cpu"]])
        text = tradeoff_figure.figure({"means": rows}, "material", cpu=True)
        self.assertIn("processor seconds", text)
        xml.dom.minidom.parseString(text)

    def test_one_row_and_none(self):
        xml.dom.minidom.parseString(tradeoff_figure.figure({"means": [row("a", 30, 1, 100, ["encode"])]}, "material"))
        with self.assertRaises(SystemExit):
            tradeoff_figure.figure({"means": []}, "brdf")


if __name__ == "__main__":
    unittest.main()
