#!/usr/bin/env python3
"""What a level of zstd costs in time, and what it gains: `patina pack` of containers at several levels.

Alternates the levels --rounds times and prints, for each, the median time, the size of the archives, what that saves of
the files, and the time of `patina unpack-archive`. At the end: what zstd saves on each kind of file, at the default level.

usage: pack_levels.py CONTAINER... [--patina BIN] [--levels 1,3,6,9,12,15,19] [--rounds 7]
"""

import argparse
import os
import re
import shutil
import statistics
import subprocess
import tempfile
import time

LINE = re.compile(r"^(\S+) +([\d.]+ \S+) +([\d.]+ \S+) +(-?[\d.]+) %$")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("containers", nargs="+", metavar="CONTAINER")
    parser.add_argument("--patina", default="build/release/bin/patina")
    parser.add_argument("--levels", default="1,3,6,9,12,15,19")
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    levels = [int(level) for level in options.levels.split(",")]
    packing = {level: [] for level in levels}
    unpacking = {level: [] for level in levels}
    sizes = dict.fromkeys(levels, 0)
    plain = 0
    with tempfile.TemporaryDirectory() as folder:
        def run(*arguments):
            start = time.perf_counter()
            done = subprocess.run([options.patina, *arguments], check=True, stdout=subprocess.PIPE, text=True)
            return time.perf_counter() - start, done.stdout

        for _ in range(options.rounds):
            for level in levels:
                pack_s = unpack_s = 0.0
                size = plain = 0
                for number, container in enumerate(options.containers):
                    archive = os.path.join(folder, f"{number}-{level}.patina")
                    pack_s += run("pack", container, "-o", archive, "--level", str(level), "-q")[0]
                    size += os.path.getsize(archive)
                    target = os.path.join(folder, "unpacked")
                    unpack_s += run("unpack-archive", archive, "-o", target, "-q")[0]
                    plain += sum(entry.stat().st_size for entry in os.scandir(target))
                    shutil.rmtree(target)
                packing[level].append(pack_s)
                unpacking[level].append(unpack_s)
                sizes[level] = size
        print(f"{len(options.containers)} containers, {plain / 1e6:.2f} MB, medians of {options.rounds} rounds")
        print("| level | packing, s | against the first | archives, MB | saved | unpacking, s |")
        print("|---|---|---|---|---|---|")
        first = statistics.median(packing[levels[0]])
        for level in levels:
            pack_s = statistics.median(packing[level])
            print(f"| {level} | {pack_s:.3f} | {pack_s / first:.2f} | {sizes[level] / 1e6:.3f} | "
                  f"{1 - sizes[level] / plain:.1%} | {statistics.median(unpacking[level]):.3f} |")
        for container in options.containers:
            print(f"\n{os.path.basename(os.path.normpath(container))}, default level")
            table = run("pack", container, "-o", os.path.join(folder, "default.patina"))[1]
            for line in table.splitlines():
                if LINE.match(line):
                    print("  " + line)


if __name__ == "__main__":
    main()
