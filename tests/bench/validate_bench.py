#!/usr/bin/env python3
"""How long `patina validate` takes, against reading and hashing the same bytes.

Copies a container until there are --copies of them, then alternates, in one run and --rounds times:
  validate   patina validate --jobs 1 on all copies (with --jobs N also on N threads)
  hash       reading every file of them and its SHA-256 (OpenSSL's, as validate uses), on one thread
  start      patina --version: what starting the program costs
and prints medians and the ratio of validate to hash, with and without the start, of wall time and of CPU time (which
others at work on the machine disturb less). The files are in the page cache.

usage: validate_bench.py --container DIR [--patina BIN] [--copies 100] [--rounds 7] [--jobs 2] [--work DIR]
"""

import argparse
import hashlib
import os
import resource
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


def cpu_seconds():
    """Of this process and of the children that have ended."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def seconds(action):
    """Wall and CPU seconds."""
    start, start_cpu = time.perf_counter(), cpu_seconds()
    action()
    return time.perf_counter() - start, cpu_seconds() - start_cpu


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
    medians, cpu = ({name: statistics.median(value[part] for value in values) for name, values in times.items()}
                    for part in (0, 1))
    print(f"{options.copies} containers of {size / options.copies / 1e6:.2f} MB, {len(paths)} files, "
          f"medians of {options.rounds} rounds")
    for name, median in medians.items():
        walls = [value[0] for value in times[name]]
        print(f"  {name:12} {median:8.3f} s  {size / median / 1e6:8.0f} MB/s  {1e3 * median / options.copies:8.2f} ms a "
              f"container, {1e3 * cpu[name] / options.copies:.2f} ms of CPU  (spread {(max(walls) - min(walls)) / median:.0%})")
    for what, of in (("wall", medians), ("CPU", cpu)):
        print(f"  validate / hash, {what} time: {of['validate'] / of['hash']:.2f}, "
              f"without the start {(of['validate'] - of['start']) / of['hash']:.2f}")


if __name__ == "__main__":
    main()
