#!/usr/bin/env python3
"""Bakes every texture set of a folder and writes one table of quality, size and speed.

Each bake is a `patina bake --json`; each set is also given to the usual codecs (patina_peers), measured by the same code
against the same reference. Results are kept in OUT/runs.jsonl, so that an interrupted run goes on where it stopped; they
are taken again when the program has changed. The tables are OUT/table.md and OUT/table.csv. Standard library only.

`--recipes patina,paper` trains the second and later recipes with as many samples as the first one took on that set and
seed, so that they are compared at equal samples.
"""

import argparse
import csv
import hashlib
import json
import os
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
IMAGES = (".png", ".jpg", ".jpeg", ".tga", ".tif", ".tiff", ".exr", ".hdr", ".dds")

# Columns of a row: key, title in the Markdown table, format.
MEASURES = [
    ("bytes", "MB", lambda v: f"{v / 1e6:.2f}"),
    ("seconds", "s", lambda v: f"{v:.1f}"),
    ("samples_per_s", "M samples/s", lambda v: f"{v / 1e6:.1f}"),
    ("psnr_overall", "PSNR overall", lambda v: f"{v:.2f}"),
    ("psnr_mip0", "mip 0", lambda v: f"{v:.2f}"),
    ("psnr_mean_mips", "mean of mips", lambda v: f"{v:.2f}"),
    ("lost_mip0", "lost mip 0", lambda v: f"{v:.2f}"),
    ("lost_mean_mips", "lost mean", lambda v: f"{v:.2f}"),
    ("lost_off_grid", "lost off grid", lambda v: f"{v:.2f}"),
    ("ssim", "SSIM", lambda v: f"{v:.4f}"),
    ("flip", "FLIP", lambda v: f"{v:.4f}"),
    ("normal_angle_deg", "normals °", lambda v: f"{v:.2f}"),
]
PEER_MEASURES = [m for m in MEASURES if not m[0].startswith(("lost_", "samples_"))]
CSV_COLUMNS = ["set", "width", "height", "channels", "codec", "nearest", "profile", "quality", "recipe", "seed", "samples",
               "stopped_by", "cpu_seconds", "peak_memory_bytes"] + [key for key, _, _ in MEASURES] + ["error"]


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0],
                                     epilog=__doc__.split("\n\n", 1)[1],
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    binaries = os.path.join(ROOT, "build", "release", "bin")
    words = lambda text: [word for word in text.split(",") if word]
    parser.add_argument("--sets", default=os.path.join(ROOT, "..", "shared", "data", "pbr"), metavar="DIR",
                        help="folder of sets (default: ../shared/data/pbr beside the project)")
    parser.add_argument("--only", type=words, default=[], metavar="NAME,...", help="only sets whose name contains one of these")
    parser.add_argument("--out", default=os.path.join(ROOT, "out", "bake_sets"), metavar="DIR")
    parser.add_argument("--patina", default=os.path.join(binaries, "patina"), metavar="FILE")
    parser.add_argument("--peers", default=os.path.join(binaries, "patina_peers"), metavar="FILE",
                        help="patina_peers, or 'none'")
    parser.add_argument("--profiles", type=words, default=["bcf-1k"], metavar="P,...")
    parser.add_argument("--qualities", type=words, default=["standard"], metavar="Q,...")
    parser.add_argument("--recipes", type=words, default=["patina", "paper"], metavar="R,...")
    parser.add_argument("--seeds", type=words, default=["1", "2", "3"], metavar="N,...")
    parser.add_argument("--samples", metavar="N", help="samples of every training, in place of the quality's own choice")
    parser.add_argument("--threads", metavar="N")
    parser.add_argument("--astc-quality", default="medium", metavar="Q", help="medium (default), thorough, ...")
    parser.add_argument("--table-only", action="store_true", help="only write the tables of the results at hand")
    return parser.parse_args()


class Store:
    """Results by key, appended to a file as they come."""

    def __init__(self, path):
        self.path = path
        self.records = {}
        if not os.path.exists(path):
            return
        with open(path, "r+", encoding="utf-8") as file:
            lines = file.read().split("\n")
            for line in lines:
                try:
                    record = json.loads(line)
                    self.records[record["key"]] = record
                except (ValueError, KeyError):
                    continue  # empty, or cut short by an interruption
            if lines[-1]:
                file.write("\n")

    def get(self, key, program):
        record = self.records.get(key)
        return record if record and record["program"] == program else None

    def put(self, key, program, rows):
        record = {"key": key, "program": program, "rows": rows}
        self.records[key] = record
        with open(self.path, "a", encoding="utf-8") as file:
            file.write(json.dumps(record) + "\n")
        return record


def file_hash(path):
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        for block in iter(lambda: file.read(1 << 20), b""):
            digest.update(block)
    return digest.hexdigest()[:16]


def find_sets(folder, only):
    sets = []
    for name in sorted(os.listdir(folder)):
        path = os.path.join(folder, name)
        if os.path.isdir(path) and any(file.lower().endswith(IMAGES) for file in os.listdir(path)):
            if not only or any(word in name for word in only):
                sets.append((name, path))
    return sets


def read_json(path):
    try:
        with open(path, encoding="utf-8") as file:
            return json.load(file)
    except (OSError, ValueError):
        return {}


def measures_of(result):
    row = {f"psnr_{key}": result["psnr"][key] for key in ("overall", "mip0", "mean_mips")} if "psnr" in result else {}
    for key in ("bytes", "seconds", "cpu_seconds", "samples", "stopped_by", "ssim", "flip", "normal_angle_deg"):
        if result.get(key) is not None:
            row[key] = result[key]
    return row


def bake_row(result, variant):
    """One table row from the JSON of one baked asset and the files of its container."""
    row = {"set": result.get("asset", ""), "codec": "patina", **variant, **measures_of(result)}
    if result.get("status") != "done":
        row["error"] = result.get("error", {}).get("message", "no result")
        return row
    report = read_json(os.path.join(result["container"], "report.json"))
    run = read_json(os.path.join(result["container"], "run.json"))
    row["width"], row["height"] = report.get("width"), report.get("height")
    row["channels"] = sum("constant" not in channel for channel in report.get("channels", []))
    row["samples_per_s"] = run.get("samples_per_s")
    row["peak_memory_bytes"] = run.get("peak_memory_bytes")
    export = report.get("training", {}).get("export", {})
    ours, floats = export.get("exported_psnr_db", {}), export.get("float_model_psnr_db", {})
    for key in ("mip0", "mean_mips", "off_grid"):
        if key in ours and key in floats:
            row["lost_" + key] = floats[key] - ours[key]
    return row


def bake(options, set_path, variant, samples):
    out = os.path.join(options.out, "bakes", "-".join(str(variant[key]) for key in ("profile", "quality", "recipe", "seed")))
    command = [options.patina, "bake", set_path, "--out", out, "--json", "--quiet", "--profile", variant["profile"],
               "--quality", variant["quality"], "--recipe", variant["recipe"], "--seed", variant["seed"]]
    if samples:
        command += ["--samples", str(samples)]
    if options.threads:
        command += ["--threads", options.threads]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode in (130, -2):
        raise KeyboardInterrupt
    lines = done.stdout.strip().splitlines()
    try:
        answer = json.loads(lines[-1]) if lines else {}
    except ValueError:
        answer = {}
    results = answer.get("assets", [answer]) if answer else []
    if not results:
        error = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        results = [{"asset": os.path.basename(set_path), "error": {"message": error[0]}}]
    return [bake_row(result, variant) for result in results]


def run_peers(options, name, set_path, size):
    command = [options.peers, set_path, "--astc-quality", options.astc_quality, "--bytes", str(size)]
    if options.threads:
        command += ["--threads", options.threads]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    rows = []
    for line in done.stdout.splitlines():
        result = json.loads(line)
        row = {key: result[key] for key in ("set", "width", "height", "channels", "codec", "nearest")}
        rows.append({**row, **measures_of(result)})
    if done.returncode != 0:
        rows.append({"set": name, "codec": "peers", "error": done.stderr.strip()})
    return rows


def mean_row(rows, keys):
    """The mean of each measure over the rows that have it; only if all have it, so that means stay comparable."""
    mean = {}
    for key in keys:
        values = [row[key] for row in rows if row.get(key) is not None]
        if values and len(values) == len(rows):
            mean[key] = sum(values) / len(values)
    return mean


def grouped(rows, key):
    groups = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    return groups


def markdown(titles, lines):
    text = ["| " + " | ".join(titles) + " |", "|" + "|".join("---" for _ in titles) + "|"]
    return "\n".join(text + ["| " + " | ".join(line) + " |" for line in lines]) + "\n"


def count(sets):
    return f"{sets} set" if sets == 1 else f"{sets} sets"


def cells(row, measures):
    return [form(row[key]) if row.get(key) is not None else "" for key, _, form in measures]


def variant_of(row):
    return row["profile"], row["quality"], row["recipe"]


def bake_table(rows):
    keys = [key for key, _, _ in MEASURES]
    lines = []
    for (name, *variant), runs in grouped(rows, lambda row: (row["set"], *variant_of(row))).items():
        first = runs[0]
        size = f"{first['width']}×{first['height']}"
        lines.append([name, size, str(first["channels"]), *variant, *cells(mean_row(runs, keys), MEASURES)])
    for variant, runs in grouped(rows, variant_of).items():
        sets = len({row["set"] for row in runs})
        lines.append([f"**mean of {count(sets)}**", "", "", *variant, *cells(mean_row(runs, keys), MEASURES)])
    titles = ["set", "size", "channels", "profile", "quality", "recipe"] + [title for _, title, _ in MEASURES]
    return markdown(titles, lines)


def recipe_table(rows, recipes):
    """The first recipe against each other one, set by set, means over the seeds that both have."""
    lines = []
    columns = ("psnr_overall", "psnr_mip0", "psnr_mean_mips")
    for other in recipes[1:]:
        for (profile, quality), runs in grouped(rows, lambda row: variant_of(row)[:2]).items():
            gains = {}
            for (name, _), pair in grouped(runs, lambda row: (row["set"], row["seed"])).items():
                by_recipe = {row["recipe"]: row for row in pair}
                if recipes[0] in by_recipe and other in by_recipe:
                    gains.setdefault(name, []).append(
                        {key: by_recipe[recipes[0]][key] - by_recipe[other][key] for key in columns})
            means = {name: mean_row(pairs, columns) for name, pairs in gains.items()}
            for name, mean in means.items():
                lines.append([name, profile, quality, f"{recipes[0]} − {other}", *[f"{mean[key]:+.2f}" for key in columns]])
            for title, fold in (("mean", lambda v: sum(v) / len(v)), ("least", min)):
                if means:
                    lines.append([f"**{title}**", profile, quality, f"{recipes[0]} − {other}",
                                  *[f"{fold([mean[key] for mean in means.values()]):+.2f}" for key in columns]])
    titles = ["set", "profile", "quality", "difference, dB at equal samples", "overall", "mip 0", "mean of mips"]
    return markdown(titles, lines) if lines else ""


def peer_table(bakes, peers, recipe):
    """Codecs beside our own rows: per set, then the mean over the sets that all of them have."""
    keys = [key for key, _, _ in PEER_MEASURES]
    own = grouped([row for row in bakes if row["recipe"] == recipe],
                  lambda row: (row["set"], f"Patina {row['profile']} {row['quality']}"))
    by_set = {}
    for (name, label), runs in own.items():
        by_set.setdefault(name, {})[label] = mean_row(runs, keys)
    nearest = {}
    for row in peers:
        by_set.setdefault(row["set"], {})[row["codec"]] = row
        if row["nearest"]:
            nearest[row["set"]] = row
    lines = []
    for name, codecs in by_set.items():
        lines += [[name, label, *cells(row, PEER_MEASURES)] for label, row in codecs.items()]
    complete = {name: codecs for name, codecs in by_set.items() if name in nearest}
    labels = []
    for codecs in complete.values():
        labels += [label for label in codecs if label not in labels]
    for label in labels:
        rows = [codecs[label] for codecs in complete.values() if label in codecs]
        if len(rows) == len(complete):
            lines.append([f"**mean of {count(len(rows))}**", label, *cells(mean_row(rows, keys), PEER_MEASURES)])
    if complete:
        lines.append([f"**mean of {count(len(complete))}**", "ASTC, nearest size",
                      *cells(mean_row([nearest[name] for name in complete], keys), PEER_MEASURES)])
    return markdown(["set", "codec"] + [title for _, title, _ in PEER_MEASURES], lines) if peers else ""


def machine():
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            models = [line.split(":", 1)[1].strip() for line in file if line.startswith("model name")]
    except OSError:
        models = []
    cpus = len(os.sched_getaffinity(0))
    return f"{models[0] if models else 'unknown CPU'}, {cpus} CPUs"


def write_tables(options, rows):
    bakes = [row for row in rows if row["codec"] == "patina" and not row.get("error")]
    peers = [row for row in rows if row["codec"] != "patina" and not row.get("error")]
    failed = {(row["set"], row["error"]) for row in rows if row.get("error")}
    parts = [f"Machine: {machine()}. Means over seeds {', '.join(options.seeds)}. \"Lost\": PSNR of the trainer's float "
             "model minus that of what was written, learned channels.\n"]
    parts.append(bake_table(bakes))
    comparison = recipe_table(bakes, options.recipes)
    if comparison:
        parts.append("\n" + comparison)
    codecs = peer_table(bakes, peers, options.recipes[0])
    if codecs:
        parts.append("\n" + codecs)
    if failed:
        parts.append("\nNot baked:\n")
        parts += [f"- {name}: {error}\n" for name, error in sorted(failed)]
    with open(os.path.join(options.out, "table.md"), "w", encoding="utf-8") as file:
        file.write("".join(parts))
    with open(os.path.join(options.out, "table.csv"), "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, CSV_COLUMNS, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def collect(options):
    """All rows, baking what is not in the store."""
    store = Store(os.path.join(options.out, "runs.jsonl"))
    patina = file_hash(options.patina)
    peers = file_hash(options.peers) if options.peers != "none" else ""
    rows = []

    def rows_of(key, program, make):
        record = store.get(key, program)
        if record is None and not options.table_only:
            print(key, file=sys.stderr, flush=True)
            record = store.put(key, program, make())
        if record is not None:
            rows.extend(record["rows"])
        return record["rows"] if record is not None else []

    for name, path in find_sets(options.sets, options.only):
        largest = 0
        for profile in options.profiles:
            for quality in options.qualities:
                for seed in options.seeds:
                    samples = options.samples
                    for recipe in options.recipes:
                        variant = {"profile": profile, "quality": quality, "recipe": recipe, "seed": seed}
                        key = f"{name} {profile} {quality} {recipe} seed {seed} samples {samples or 'by quality'}"
                        made = rows_of(key, patina, lambda: bake(options, path, variant, samples))
                        done = [row for row in made if not row.get("error")]
                        largest = max([largest] + [row["bytes"] for row in done])
                        if not done:
                            break
                        # A folder of several sets is trained with the larger number: enough for all.
                        samples = samples or int(max(row.get("samples", 0) for row in done)) or None
        if options.peers != "none" and largest > 0:
            key = f"{name} peers {options.astc_quality} {largest} bytes"
            rows_of(key, peers, lambda: run_peers(options, name, path, largest))
    return rows


def main():
    options = parse_arguments()
    for program in (options.patina, options.peers):
        if program != "none" and not os.access(program, os.X_OK):
            print(f"{program} is not there: cmake --build --preset release --target patina patina_peers", file=sys.stderr)
            return 2
    if not os.path.isdir(options.sets):
        print(f"{options.sets} is not a folder of sets", file=sys.stderr)
        return 2
    os.makedirs(options.out, exist_ok=True)
    rows = collect(options)
    write_tables(options, rows)
    print(os.path.join(options.out, "table.md"))
    return 0 if rows and not any(row.get("error") for row in rows) else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        print("interrupted; run the same command again to go on", file=sys.stderr)
        sys.exit(130)
