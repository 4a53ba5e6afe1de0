#!/usr/bin/env python3
"""Counts what a decoder's shader does for one pixel, from its SPIR-V.

usage: shader_cost.py FOLDER...     as `patina shader CONTAINER --out FOLDER --lang hlsl` wrote it

The shader is compiled by glslang, inlined, unrolled and optimised by spirv-opt; then the instructions of the function that
is left are counted as they stand, both sides of a branch included:
  arithmetic   each component of a result is one operation; a 4 x 4 matrix times a vector is 16 multiply-adds
  functions    min, max, clamp, log2, pow, sqrt and so on, each component
  samples      texture samples and fetches
  loads        of constants: vectors or matrices
The first row is the same material as three plain textures: albedo, normal with its z, and three channels.
"""

import json
import os
import re
import subprocess
import sys
import tempfile

PLAIN = """
Texture2D<float4> a : register(t0);
Texture2D<float4> b : register(t1);
Texture2D<float4> c : register(t2);
SamplerState s : register(s0);
float4 main(float4 p : TEXCOORD0) : SV_Target {
  float2 n = 2.0 * b.Sample(s, p.xy).xy - 1.0;
  return float4(a.Sample(s, p.xy).xyz, n.x + n.y + sqrt(max(0.0, 1.0 - dot(n, n)))) + c.Sample(s, p.xy).xyzz;
}
"""
MATERIAL = """
float4 main(float4 p : TEXCOORD0) : SV_Target {
  PatinaMaterial m = patina_material(p.xy);
  float4 sum = float4(0, 0, 0, 0);
  [unroll] for (int i = 0; i < PATINA_MATERIAL_CHANNELS; ++i) sum[i % 4] += m.value[i];
  return sum;
}
"""
BRDF = """
float4 main(float3 wi : TEXCOORD0, float3 wo : TEXCOORD1) : SV_Target { return float4(patina_brdf(wi, wo), 1.0); }
"""
MOVES = {"OpCompositeExtract", "OpCompositeConstruct", "OpCompositeInsert", "OpVectorShuffle", "OpAccessChain", "OpPhi",
         "OpVariable", "OpCopyObject", "OpSampledImage", "OpUndef", "OpFunction", "OpBitcast", "OpCompositeInsert",
         "OpVectorExtractDynamic", "OpTranspose"}


def compile_pixel(text, folder):
    """The optimised SPIR-V of a pixel shader, disassembled."""
    source, spirv, optimised = (os.path.join(folder, name) for name in ("shader.hlsl", "a.spv", "b.spv"))
    with open(source, "w", encoding="utf-8") as file:
        file.write(text)
    subprocess.run(["glslangValidator", "-D", "-V", "-S", "frag", "-e", "main", "--shift-sampler-binding", "80",
                    "--shift-UBO-binding", "100", "-o", spirv, source], check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["spirv-opt", "--inline-entry-points-exhaustive", "-O", "--loop-unroll", "-O", spirv, "-o", optimised],
                   check=True)
    return subprocess.run(["spirv-dis", optimised], check=True, stdout=subprocess.PIPE, text=True).stdout


def count(disassembly):
    """{kind: number} of the functions in a disassembled module."""
    components = {}
    counts = {"arithmetic": 0, "functions": 0, "samples": 0, "loads": 0, "branches": 0}
    body = False
    for line in disassembly.splitlines():
        words = line.split()
        if "OpTypeVector" in words:
            components[words[0]] = int(words[-1])
        body = body or "OpFunction" in words
        if not body or not words:
            continue
        if words[0] == "OpLoopMerge":
            raise ValueError("a loop is left: its length is not known here")
        if words[0] in ("OpBranchConditional", "OpSwitch"):
            counts["branches"] += 1
        if len(words) < 4 or words[1] != "=" or words[2] in MOVES or words[2] == "OpLabel":
            continue
        operation, size = words[2], components.get(words[3], 1)
        if re.match(r"OpImage(Sample|Fetch)", operation):
            counts["samples"] += 1
        elif operation == "OpLoad":
            # Loads of handles and of inputs are not reads of constants.
            counts["loads"] += 1 if re.match(r"%(v4float|mat4v4float|float)$", words[3]) else 0
        elif operation in ("OpMatrixTimesVector", "OpVectorTimesMatrix"):
            counts["arithmetic"] += 16
        elif operation == "OpExtInst":
            counts["functions"] += size
        else:
            counts["arithmetic"] += size
    return counts


def main():
    if len(sys.argv) < 2:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        rows.append(("three plain textures", count(compile_pixel(PLAIN, folder))))
        for path in sys.argv[1:]:
            with open(os.path.join(path, "bindings.json"), encoding="utf-8") as file:
                bindings = json.load(file)
            with open(os.path.join(path, bindings["shader"]), encoding="utf-8") as file:
                text = file.read()
            main_text = BRDF if bindings["kind"] == "brdf" else MATERIAL
            try:
                counted = count(compile_pixel("#define PATINA_DERIVATIVES\n" + text + main_text, folder))
            except ValueError as error:
                print(f"{path}: {error}", file=sys.stderr)
                return 1
            rows.append((bindings["asset"], counted))
    kinds = list(rows[0][1])
    print("| shader | " + " | ".join(kinds) + " |")
    print("|---" * (len(kinds) + 1) + "|")
    for name, counted in rows:
        print(f"| {name} | " + " | ".join(str(counted[kind]) for kind in kinds) + " |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
