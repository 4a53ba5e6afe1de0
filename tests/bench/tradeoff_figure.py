#!/usr/bin/env python3
"""Draws the fronts of a sweep as one SVG, for documents.

    tradeoff_figure.py SWEEP/tradeoff.json FIGURE.svg [--kind material|brdf] [--cpu]

--cpu: processor seconds in place of wall seconds, for a sweep on a machine that had other work.
Three plots side by side: quality against seconds of encoding, bytes and nanoseconds of decoding, each with a logarithmic
axis; configurations on the front are filled and joined. Standard library only.
"""
import argparse
import json
import math
from xml.sax.saxutils import escape

COSTS = (("encode_s", "encode", "seconds to bake"), ("bytes", "bytes", "bytes to load"),
         ("decode_ns", "decode", "ns of a lookup, one core"))
CPU_COST = ("encode_cpu_s", "cpu", "processor seconds to bake")
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 300, 260, 44, 12, 14, 46

STYLE = """text{font:11px system-ui,sans-serif;fill:#1c1b19}.a{stroke:#5d5a54;fill:none}.g{stroke:#dcd8cf}
.f{fill:#0067a3}.l{stroke:#0067a3;fill:none;stroke-width:1.8}.o{fill:none;stroke:#8a8579;stroke-width:1.3}
@media(prefers-color-scheme:dark){text{fill:#ece8e1}.a{stroke:#aaa49a}.g{stroke:#38342f}.f{fill:#62b6ef}.l{stroke:#62b6ef}}"""


def ticks_of_log(low, high):
    ticks = [factor * 10.0 ** power for power in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
             for factor in (1, 2, 5)]
    ticks = [tick for tick in ticks if low <= tick <= high]
    return ticks if len(ticks) > 1 else [low, high]


def short(value):
    for limit, unit in ((1e6, "M"), (1e3, "k")):
        if value >= limit:
            return f"{value / limit:g}{unit}"
    return f"{value:.3g}"


def plot(rows, cost, front, label, unit):
    values, quality = [max(row[cost], 1e-9) for row in rows], [row["quality_db"] for row in rows]
    low_x, high_x = min(values) / 1.25, max(values) * 1.25
    span = max(quality) - min(quality) or 1
    low_y, high_y = min(quality) - 0.08 * span, max(quality) + 0.08 * span
    at_x = lambda v: LEFT + math.log(v / low_x) / math.log(high_x / low_x) * (WIDTH - LEFT - RIGHT)
    at_y = lambda v: HEIGHT - BOTTOM - (v - low_y) / (high_y - low_y) * (HEIGHT - TOP - BOTTOM)
    out = []
    step = next(s for s in (0.5, 1, 2, 5, 10, 20) if span / s <= 6)
    for k in range(math.ceil(low_y / step), math.floor(high_y / step) + 1):
        y = at_y(k * step)
        out.append(f'<path class="g" d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}"/>'
                   f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{k * step:g}</text>')
    for tick in ticks_of_log(low_x, high_x):
        out.append(f'<text x="{at_x(tick):.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{short(tick)}</text>')
    out.append(f'<path class="a" d="M{LEFT} {TOP}V{HEIGHT - BOTTOM}H{WIDTH - RIGHT}"/>'
               f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 10}" text-anchor="middle">{escape(label)}</text>'
               f'<text transform="translate(12 {(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)" text-anchor="middle">{unit}</text>')
    best = sorted((x, q) for row, x, q in zip(rows, values, quality) if front in row["fronts"])
    out.append('<path class="l" d="M' + "L".join(f"{at_x(x):.1f} {at_y(q):.1f}" for x, q in best) + '"/>')
    for row, x, q in zip(rows, values, quality):
        name = escape(f'{row["variant"]}: {q:.2f} dB, {row["encode_s"]:.1f} s, {row["bytes"]} bytes, {row["decode_ns"]:.0f} ns')
        shape = "f" if front in row["fronts"] else "o"
        out.append(f'<circle class="{shape}" cx="{at_x(x):.1f}" cy="{at_y(q):.1f}" r="4"><title>{name}</title></circle>')
    return "".join(out)


def with_front(rows, cost, front):
    """The rows that no other beats in both quality and cost are on the front."""
    def beaten(row):
        return any(other["quality_db"] >= row["quality_db"] and other[cost] <= row[cost] and
                   (other["quality_db"], -other[cost]) != (row["quality_db"], -row[cost]) for other in rows)
    return [{**row, "fronts": row["fronts"] + ([] if beaten(row) else [front])} for row in rows]


def figure(sweep, kind, cpu=False):
    rows = [row for row in sweep["means"] if row["kind"] == kind and "problem" not in row]
    if not rows:
        raise SystemExit(f"no means of kind {kind}: sweep inputs of that kind first")
    costs = COSTS
    if cpu:
        costs = (CPU_COST, *COSTS[1:])
        rows = with_front(rows, *CPU_COST[:2])
    unit = "PSNR over all mips, dB" if kind == "material" else "PSNR of the lit sphere, dB"
    plots = "".join(f'<g transform="translate({WIDTH * i} 0)">{plot(rows, cost, front, label, unit)}</g>'
                    for i, (cost, front, label) in enumerate(costs))
    title = f"Quality against encode time, bytes and decode time: means of {rows[0]['inputs']} inputs, {len(rows)} configurations"
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {3 * WIDTH} {HEIGHT}" role="img" aria-label="{escape(title)}">'
            f"<title>{escape(title)}</title><style>{STYLE}</style>{plots}</svg>\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweep")
    parser.add_argument("figure")
    parser.add_argument("--kind", choices=("material", "brdf"), default="material")
    parser.add_argument("--cpu", action="store_true")
    options = parser.parse_args()
    with open(options.sweep, encoding="utf-8") as file:
        sweep = json.load(file)
    with open(options.figure, "w", encoding="utf-8") as file:
        file.write(figure(sweep, options.kind, options.cpu))


if __name__ == "__main__":
    main()
