#!/usr/bin/env python3
"""How long `patina validate` takes, against reading and hashing the same bytes.

Copies a container until there are --copies of them, then alternates, in one run and --rounds times:
  validate   patina validate --jobs 1 on all copies (with --jobs N also on N threads)
  hash       reading every file of them and its SHA-256 (OpenSSL's, as validate uses), on one thread
  start      patina --version: what starting the program costs
and prints medians and the ratio of validate to hash, with and without the start. The files are in the page cache.

usage: validate_bench.py --container DIR [--patina BIN] [--copies 100] [--rounds 7] [--jobs 2] [--work DIR]
"""

import argparse
import hashlib
import os
import shutil
import statistics
import subprocess
import tempfile
import time


def files_below(folder):
    return sorted(os.path.join(path, name) for path, _, names in os.walk(folder) for name in names)


def hash_all(paths):
    for path in paths:
        digest = hashlib.sha256()
        with open(path, "rb") as file:
            while piece := file.read(1 << 20):
                digest.update(piece)


def seconds(action):
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--container", required=True, help="folder of a revision, with its manifest.json")
    parser.add_argument("--patina", default="build/release/bin/patina")
    parser.add_argument("--copies", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--work", help="where to put the copies (default: a temporary folder)")
    options = parser.parse_args()
    source = os.path.realpath(options.container)
    if not os.path.isfile(os.path.join(source, "manifest.json")):
        parser.error(f"{options.container} holds no manifest.json")
    with tempfile.TemporaryDirectory(dir=options.work) as folder:
        for i in range(options.copies):
            shutil.copytree(source, os.path.join(folder, f"copy{i:05}"))
        paths = files_below(folder)
        size = sum(os.path.getsize(path) for path in paths)

        def run(*arguments):
            subprocess.run([options.patina, *arguments], check=True, stdout=subprocess.DEVNULL)

        actions = {
            "validate": lambda: run("validate", folder, "--jobs", "1", "-q"),
            f"validate x{options.jobs}": lambda: run("validate", folder, "--jobs", str(options.jobs), "-q"),
            "hash": lambda: hash_all(paths),
            "start": lambda: run("--version"),
        }
        times = {name: [] for name in actions}
        for _ in range(options.rounds):
            for name, action in actions.items():
                times[name].append(seconds(action))
    medians = {name: statistics.median(values) for name, values in times.items()}
    print(f"{options.copies} containers of {size / options.copies / 1e6:.2f} MB, {len(paths)} files, "
          f"medians of {options.rounds} rounds")
    for name, median in medians.items():
        spread = (max(times[name]) - min(times[name])) / median
        print(f"  {name:12} {median:8.3f} s  {size / median / 1e6:8.0f} MB/s  "
              f"{1e3 * median / options.copies:8.2f} ms a container  (spread {spread:.0%})")
    whole, work = medians["validate"], medians["validate"] - medians["start"]
    print(f"  validate / hash: {whole / medians['hash']:.2f}, without the start {work / medians['hash']:.2f}")


if __name__ == "__main__":
    main()
