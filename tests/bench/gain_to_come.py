#!/usr/bin/env python3
"""What trainings gained after a part of their samples, against the bound that gives hopeless ones up.

    gain_to_come.py FOLDER...     every container below the folders, each training once

For 1/16, 1/8, 1/4 and 1/2 of the samples: trainings, median and most of what mip 0 still gained in dB, the bound of
GainToCome (pipeline/material/train.cpp), and how many gained more. Standard library only.
"""
import json
import math
import os
import statistics
import sys

SHARES = (16, 8, 4, 2)


def bound(share):
    return 1 + 1.9 * math.log2(share)


def curves(folders):
    """{fingerprint: [(samples, dB of mip 0)]} of our own recipe's whole trainings."""
    found = {}
    for folder in folders:
        for place, _, files in os.walk(folder):
            if "manifest.json" not in files:
                continue
            try:
                with open(os.path.join(place, "manifest.json"), encoding="utf-8") as file:
                    manifest = json.load(file)
                training = manifest["training"]
                if manifest["tool"]["recipe"] == "patina" and training["stopped_by"] == "budget":
                    found[manifest["fingerprint"]] = [(p["samples"], p["psnr_mip0_db"]) for p in training["curve"]
                                                      if p["psnr_mip0_db"] is not None]
            except (OSError, ValueError, KeyError, TypeError):
                continue  # of another kind, or not a container
    return found


def gains(curve, share):
    """What came after the reading nearest to 1/share of the samples; none if there is no such reading."""
    if len(curve) < 3:
        return []
    last_samples, last_db = curve[-1]
    near = [db for samples, db in curve[:-1] if samples > 0 and abs(math.log2(last_samples / samples / share)) < 0.25]
    return [last_db - near[0]] if near else []


def table(folders):
    found = curves(folders)
    lines = ["| done | trainings | median gain | most | bound | beyond it |", "|---|---|---|---|---|---|"]
    for share in SHARES:
        values = [gain for curve in found.values() for gain in gains(curve, share)]
        if values:
            lines.append(f"| 1/{share} | {len(values)} | {statistics.median(values):.2f} dB | {max(values):.2f} dB "
                         f"| {bound(share):.2f} dB | {sum(v > bound(share) for v in values)} |")
    return lines


def main():
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        print(__doc__)
        raise SystemExit(2)
    print("\n".join(table(sys.argv[1:])))


if __name__ == "__main__":
    main()
