#!/usr/bin/env python3
"""What each effect brings: bakes assets with it on and off, in turn, and writes a table.

    effects_bench.py [--sets FOLDER] [--only NAME,...]    one row for each asset and effect that changes something
    effects_bench.py --scenes-only ...                     each scene once: what was learned, constant, derived, left out

Inputs are the folders of --sets and the glTF files below it, each material by itself; the mips of the effect `mips` are
--lod-range. Every asset is baked with all effects, with each effect turned off in turn, and with nothing left out
(`--learn-all`), `--rounds` times in turn; times are medians, in seconds of CPU of the stages reference and train. Decode
times are those of patina_decode_bench, in one process for all variants of an asset. PSNR is the mean
of the maps that all variants learn, as each bake measured them on what it wrote; with `mips` over the mips that are left. Effects that change nothing in an
asset (the same outputs and bytes) have no row.

OUT/effects.md has the tables, OUT/rows.jsonl the figures. Standard library only.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
EFFECTS = ("constant", "equal", "unused", "alpha", "unlit", "mips")
SCENES = (".gltf", ".glb", ".patina.json")


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    binaries = os.path.join(ROOT, "build", "release", "bin")
    words = lambda text: [word for word in text.split(",") if word]
    parser.add_argument("--sets", default=os.path.join(ROOT, "..", "shared", "data", "pbr"), metavar="DIR")
    parser.add_argument("--only", type=words, default=[], metavar="NAME,...", help="inputs whose path contains one of these")
    parser.add_argument("--out", default=os.path.join(ROOT, "out", "effects_bench"), metavar="DIR")
    parser.add_argument("--bin", default=binaries, metavar="DIR", help="folder of patina and patina_decode_bench")
    parser.add_argument("--profile", default="bcf-1k")
    parser.add_argument("--quality", default="standard")
    parser.add_argument("--samples", help="samples of every training")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--effects", type=words, default=list(EFFECTS), metavar="NAME,...", help="effects to turn off in turn")
    parser.add_argument("--lod-range", default="1,4", help="for the effect `mips`; 'none' leaves it out")
    parser.add_argument("--scenes-only", action="store_true", help="bake each scene once, and write only its summary")
    return parser.parse_args()


def find_inputs(folder, only):
    """Scene files below a folder, and folders of images without a scene."""
    inputs = []
    for place, folders, files in sorted(os.walk(folder)):
        folders.sort()
        scenes = [os.path.join(place, name) for name in sorted(files) if name.lower().endswith(SCENES)]
        images = any(name.lower().endswith((".png", ".jpg", ".jpeg", ".tif", ".exr", ".tga")) for name in files)
        inputs += scenes or ([place] if images else [])
    return [path for path in inputs if not only or any(word in path for word in only)]


def bake(options, source, out, extra):
    """The results of one `patina bake`, a list; assets that failed have an error."""
    command = [os.path.join(options.bin, "patina"), "bake", source, "--out", out, "--quality", options.quality,
               "--profile", options.profile, "--json", "--quiet"] + extra
    if options.samples:
        command += ["--samples", options.samples]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    try:
        result = json.loads(done.stdout.strip().splitlines()[-1])
    except (IndexError, ValueError):
        raise SystemExit(f"effects_bench: {' '.join(command)} said {done.stderr.strip()}")
    return result.get("assets", [result])


def load(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def describe(result):
    """What a bake made: figures of its manifest and its run."""
    container = result["container"]
    manifest, run = load(os.path.join(container, "manifest.json")), load(os.path.join(container, "run.json"))
    network = manifest.get("network", {"inputs": 0, "hidden": 0, "outputs": 0})
    return {
        "container": container,
        "cpu_s": sum(s["cpu_seconds"] for s in run["stages"] if s["stage"] in ("reference", "train")),
        "bytes": sum(p["bytes"] for p in manifest["payloads"] if p["role"] in ("features", "weights")),
        "outputs": network["outputs"],
        "multiply_adds": network["hidden"] * (network["inputs"] + network["outputs"]),
        "maps": {m["map"]: m["overall"].get("psnr_db") for m in manifest["quality"]["maps"]},
        "learned_maps": sorted({c["map"] for c in manifest["channels"] if "output" in c}),
        "effects": manifest["effects"],
    }


def mean_psnr(figures, maps):
    """Mean over maps of the PSNR of each; maps without an error are left out."""
    values = [figures["maps"][m] for m in maps if figures["maps"].get(m) is not None]
    return statistics.mean(values) if values else float("nan")


def variants(options):
    lod = [] if options.lod_range == "none" else ["--lod-range", options.lod_range]
    yield "all effects", []
    for effect in options.effects:
        if effect != "mips":
            yield f"without {effect}", ["--effect-off", effect]
    if lod and "mips" in options.effects:
        yield "with mips", lod
    yield "nothing left out", ["--learn-all"]


def measure(options, source):
    """Rows of one input: asset, variant, medians."""
    kept = {}
    for turn in range(options.rounds):
        for name, extra in variants(options):
            out = os.path.join(options.out, "baked", name.replace(" ", "_"))
            for result in bake(options, source, out, extra):
                if "container" not in result:
                    if turn == 0 and name == "all effects":
                        print(f"effects_bench: {result.get('asset')}: {result.get('error', {}).get('message')}", file=sys.stderr)
                    continue
                kept.setdefault(result["asset"], {}).setdefault(name, []).append(describe(result))
    rows = []
    for asset, runs in sorted(kept.items()):
        if "all effects" not in runs or "nothing left out" not in runs:
            continue
        last = {name: figures[-1] for name, figures in runs.items()}
        decode = subprocess.run([os.path.join(options.bin, "patina_decode_bench")] + [f["container"] for f in last.values()],
                                capture_output=True, text=True, check=True)
        times = json.loads(decode.stdout)
        # What every variant learns: constants have no error wherever they are.
        common = set.intersection(*(set(f["learned_maps"]) for f in last.values()))
        for name, figures in last.items():
            rows.append({"asset": asset, "variant": name, "outputs": figures["outputs"], "bytes": figures["bytes"],
                         "multiply_adds": figures["multiply_adds"], "decode_ns": times[figures["container"]],
                         "cpu_s": statistics.median(f["cpu_s"] for f in runs[name]),
                         "psnr": mean_psnr(figures, sorted(common)), "maps": sorted(common)})
    return rows


def effect_table(rows):
    lines = ["| asset | variant | outputs | CPU s | bytes | decode ns a texel | PSNR of shared maps |", "|---|---|---|---|---|---|---|"]
    by_asset = {}
    for row in rows:
        by_asset.setdefault(row["asset"], []).append(row)
    for asset, variants_of in by_asset.items():
        base = next(r for r in variants_of if r["variant"] == "all effects")
        if not any(row["outputs"] for row in variants_of):
            continue  # numbers alone, whatever is asked for
        for row in variants_of:
            same = row["outputs"] == base["outputs"] and row["bytes"] == base["bytes"]
            if row is not base and same and row["variant"] != "nothing left out":
                continue
            lines.append(f"| {asset} | {row['variant']} | {row['outputs']} | {row['cpu_s']:.2f} | {row['bytes']} "
                         f"| {row['decode_ns']:.1f} | {row['psnr']:.2f} |".replace(" nan ", " - "))
    return lines


def constants_table(rows):
    """The same sets with their constants learned: is it slower, and worse?"""
    lines = ["", "Constants as numbers against learned:", "",
             "| asset | outputs | CPU | bytes | decode | PSNR |", "|---|---|---|---|---|---|"]
    by_key = {(r["asset"], r["variant"]): r for r in rows}
    ratios = []
    for row in rows:
        base = by_key[(row["asset"], "all effects")]
        if row["variant"] != "without constant" or row["outputs"] == base["outputs"] or not base["outputs"]:
            continue
        ratios.append((base["cpu_s"] / row["cpu_s"], base["decode_ns"] / row["decode_ns"], base["psnr"] - row["psnr"]))
        lines.append(f"| {row['asset']} | {row['outputs']} → {base['outputs']} | × {ratios[-1][0]:.3f} "
                     f"| {base['bytes'] - row['bytes']:+d} | × {ratios[-1][1]:.3f} | {ratios[-1][2]:+.2f} dB |")
    if ratios:
        mean = [statistics.mean(column) for column in zip(*ratios)]
        lines.append(f"| **mean of {len(ratios)}** | | × {mean[0]:.3f} | | × {mean[1]:.3f} | {mean[2]:+.2f} dB |")
    return lines


def scene_summary(options, scenes):
    """Each scene's materials: how many channels are learned, constant, derived, left out, and what that saved."""
    lines = ["", "Scenes, sums over their materials (saved: bytes of the engine's files, multiply-adds of a lookup):", "",
             "| scene | materials baked | learned | constant | derived | left out | bytes saved | multiply-adds saved |",
             "|---|---|---|---|---|---|---|---|"]
    for source in scenes:
        results = bake(options, source, os.path.join(options.out, "baked", "all_effects"), [])
        done = [describe(r) for r in results if "container" in r]
        effects = [e for figures in done for e in figures["effects"]]
        count = lambda state: sum(e["state"] == state for e in effects)
        saved = lambda key: sum(e.get("saved", {}).get(key, 0) for e in effects)
        lines.append(f"| {os.path.basename(source)} | {len(done)} of {len(results)} | {count('learned')} | {count('constant')} "
                     f"| {count('derived')} | {count('left_out')} | {saved('bytes')} | {saved('decode_multiply_adds')} |")
        print(lines[-1], flush=True)
        for result in results:
            if "container" not in result:
                print(f"effects_bench: {result.get('asset')}: {result.get('error', {}).get('message')}", file=sys.stderr)
    return lines


def main():
    options = parse_arguments()
    os.makedirs(options.out, exist_ok=True)
    inputs = find_inputs(options.sets, options.only)
    if not inputs:
        raise SystemExit(f"effects_bench: nothing to bake in {options.sets}")
    lines, rows = [], []
    if not options.scenes_only:
        with open(os.path.join(options.out, "rows.jsonl"), "w", encoding="utf-8") as file:
            for source in inputs:
                for row in measure(options, source):
                    rows.append(row)
                    file.write(json.dumps(row) + "\n")
                    file.flush()
        lines = effect_table(rows) + constants_table(rows)
    lines += scene_summary(options, [path for path in inputs if path.lower().endswith(SCENES)])
    path = os.path.join(options.out, "effects.md")
    with open(path, "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")
    print("\n".join(lines))
    print(path)


if __name__ == "__main__":
    main()
