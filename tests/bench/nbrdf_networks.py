#!/usr/bin/env python3
"""Converts published NBRDF networks to the text that patina_brdf_eval --nbrdf reads.

usage: nbrdf_networks.py NETWORKS.npz OUT.txt

The .npz holds, for each material, NAME/k0 .. NAME/k2 of shape [inputs][outputs] and NAME/b0 .. NAME/b2, little-endian
float32 in C order, of the shapes 6-21-21-3. A line of OUT.txt is a name and 675 numbers: for each layer the weights, row
by row, then the biases.
"""

import ast
import struct
import sys
import zipfile

SHAPES = [("k0", (6, 21)), ("b0", (21,)), ("k1", (21, 21)), ("b1", (21,)), ("k2", (21, 3)), ("b2", (3,))]


def read_array(data, shape):
    """The numbers of a .npy file of this shape; ValueError for any other."""
    if data[:6] != b"\x93NUMPY" or len(data) < 12:
        raise ValueError("not a .npy array")
    wide = data[6] >= 2
    start = 12 if wide else 10
    length = struct.unpack("<I" if wide else "<H", data[8:start])[0]
    try:
        header = ast.literal_eval(data[start:start + length].decode("latin-1"))
        described = (header["descr"], header["fortran_order"], tuple(header["shape"]))
    except (SyntaxError, KeyError, TypeError) as error:
        raise ValueError(f"a header that does not parse: {error}") from error
    if described != ("<f4", False, shape):
        raise ValueError(f"{described} instead of little-endian float32 of shape {shape} in C order")
    count = 1
    for side in shape:
        count *= side
    if len(data) != start + length + 4 * count:
        raise ValueError(f"{len(data) - start - length} bytes of numbers instead of {4 * count}")
    return struct.unpack(f"<{count}f", data[start + length:])


def read_networks(path):
    """{name: 675 numbers}, by name."""
    networks = {}
    with zipfile.ZipFile(path) as archive:
        entries = set(archive.namelist())
        for name in sorted({entry.split("/")[0] for entry in entries if "/" in entry}):
            numbers = []
            for array, shape in SHAPES:
                entry = f"{name}/{array}.npy"
                if entry not in entries:
                    raise ValueError(f"{path}: {entry} is missing")
                try:
                    numbers.extend(read_array(archive.read(entry), shape))
                except ValueError as error:
                    raise ValueError(f"{path}: {entry}: {error}") from error
            networks[name] = numbers
    return networks


def main():
    if len(sys.argv) != 3:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    try:
        networks = read_networks(sys.argv[1])
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        print(f"nbrdf_networks.py: {error}", file=sys.stderr)
        return 1
    with open(sys.argv[2], "w", encoding="utf-8") as out:
        for name, numbers in networks.items():
            # Nine digits bring every float back.
            out.write(" ".join([name] + [f"{number:.9g}" for number in numbers]) + "\n")
    print(f"{len(networks)} networks")
    return 0


if __name__ == "__main__":
    sys.exit(main())
