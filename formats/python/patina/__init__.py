"""Bake materials, and decode what was baked into numpy arrays.

    import patina
    wall, = patina.bake("textures/wall", out="baked", quality="preview")
    maps = wall.decode()                       # {"albedo": (H, W, 3), "normal": (H, W, 3), "roughness": (H, W), ...}
    maps = wall.decode(level=2, coded=True)    # a coarser mip, as the channels are coded
    values = wall.sample(uv, lod=1.5)          # the same keys, values at N texture coordinates
    chrome, = patina.bake("chrome.binary", out="baked")
    f = chrome.evaluate(wi, wo)                # (N, 3), 1/sr, without the cosine
    f = cloth.evaluate(wi, wo, uv, lod=1)      # of one that varies over the surface

Physical values: linear colours of the container's working space, unit normals of tangent space (OpenGL), the rest as it is.
"""
import json
import os
import shutil
import subprocess

import numpy

from . import _native

__all__ = ["BakeError", "Container", "bake"]


class BakeError(RuntimeError):
    """What `patina bake` said. exit_code: 3 bad input, 4 a quality or size that was missed, 130 interrupted, 1 anything else."""

    def __init__(self, message, exit_code):
        super().__init__(message)
        self.exit_code = exit_code


def _program():
    """$PATINA, else that of the same installation or build, else the one on the PATH."""
    named = os.environ.get("PATINA")
    if named:
        return named
    folder = os.path.dirname(os.path.abspath(__file__))
    while folder != os.path.dirname(folder):
        folder = os.path.dirname(folder)
        beside = os.path.join(folder, "bin", "patina")
        if os.access(beside, os.X_OK):
            return beside
    found = shutil.which("patina")
    if found is None:
        raise FileNotFoundError("the program `patina` is not on the PATH; install it, or set PATINA to where it lies")
    return found


def _words(options):
    words = []
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            words.append(flag)
        elif isinstance(value, (list, tuple)):
            for entry in value:
                words += [flag, str(entry)]
        else:
            words += [flag, str(value)]
    return words


def bake(*inputs, out, **options):
    """Bakes what `patina bake` takes (folders of maps, scenes, BRDF files, job files) and returns a list of Containers.

    options: those of the command, with _ for -: quality="preview", target_psnr=32, threads=2, material=["tile", "wood"].
    Raises BakeError with the messages of all assets that failed; those that did not are published.
    """
    if not inputs:
        raise TypeError("bake() needs at least one input")
    command = [_program(), "bake", *map(os.fspath, inputs), "--out", os.fspath(out), "--json", "--quiet", *_words(options)]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode != 0:
        raise BakeError(done.stderr.strip() or f"patina bake ended with {done.returncode}", done.returncode)
    results = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    return [Container(result["container"]) for result in results if result.get("container")]


class Container:
    """A baked material or BRDF. path: a revision's folder, or an asset's, whose current revision is taken."""

    def __init__(self, path):
        path = os.fspath(path)
        if not os.path.exists(os.path.join(path, "manifest.json")) and os.path.isdir(os.path.join(path, "current")):
            path = os.path.realpath(os.path.join(path, "current"))
        self.path = path
        with open(os.path.join(path, "manifest.json"), encoding="utf-8") as file:
            self.manifest = json.load(file)
        self.kind = self.manifest.get("kind", "material")
        decoders = {"material": _native.Material, "brdf": _native.Brdf, "svbrdf": _native.Svbrdf}
        if self.kind not in decoders:
            raise ValueError(f"{path}: kind {self.kind} is not decoded here yet; formats/FORMATS.md names the header that does")
        self._decoder = decoders[self.kind](path)

    def __repr__(self):
        return f"<patina.Container {self.kind} {self.asset!r}>"

    @property
    def asset(self):
        return self.manifest["asset"]

    def _of(self, kinds, what):
        if self.kind not in kinds:
            raise TypeError(f"{self.asset} is of kind {self.kind}: {what}")
        return self._decoder

    @property
    def size(self):
        """Width and height of mip 0, in texels."""
        decoder = self._of(("material", "svbrdf"), "it has no texels")
        return decoder.width, decoder.height

    @property
    def levels(self):
        return self._of(("material", "svbrdf"), "it has no mips").levels

    @staticmethod
    def _places(uv, lod):
        """Rows of u, v and level of detail."""
        uv = numpy.asarray(uv, dtype=numpy.float32)
        if uv.ndim != 2 or uv.shape[1] != 2:
            raise ValueError("uv: an array of N rows of 2 numbers is needed")
        lods = numpy.broadcast_to(numpy.asarray(lod, dtype=numpy.float32), uv.shape[:1])
        return numpy.column_stack([uv, lods])

    def _maps(self, planes, coded):
        """Channels, first axis, to a map each, last axis; z of normals is added to physical values."""
        maps = {}
        for index, channel in enumerate(self._decoder.channels):
            maps.setdefault(channel["map"], []).append((channel, planes[index]))
        for name, channels in maps.items():
            values = [plane for _, plane in channels]
            if not coded and channels[0][0]["encoding"] == "normal_xy" and len(values) == 2:
                values.append(numpy.sqrt(numpy.maximum(0, 1 - values[0] ** 2 - values[1] ** 2)))
            maps[name] = values[0] if len(values) == 1 else numpy.stack(values, axis=-1)
        return maps

    def decode(self, level=0, coded=False):
        """All maps of a mip: {name: float32 array (H, W) or (H, W, channels)}."""
        return self._maps(self._of(("material",), "use evaluate()").decode_mip(level, not coded), coded)

    def sample(self, uv, lod=0.0, coded=False):
        """All maps at texture coordinates (N, 2), v downwards, and mips `lod` (a number, or N of them)."""
        decoder = self._of(("material",), "use evaluate()")
        return self._maps(decoder.sample(self._places(uv, lod), not coded).T, coded)

    def evaluate(self, wi, wo, uv=None, lod=0.0):
        """f(wi, wo) of a BRDF, (N, 3), 1/sr, without the cosine. Directions: unit vectors (N, 3), z along the normal.

        One that varies over the surface (kind svbrdf) has it at places: uv and lod, as of sample().
        """
        decoder = self._of(("brdf", "svbrdf"), "use decode() or sample()")
        if self.kind == "svbrdf":
            if uv is None:
                raise TypeError(f"{self.asset} varies over the surface: evaluate() needs uv, N rows of texture coordinates")
            return decoder.evaluate(wi, wo, self._places(uv, lod))
        if uv is not None:
            raise TypeError(f"{self.asset} is the same everywhere: evaluate() takes no uv")
        return decoder.evaluate(wi, wo)

    def sample_directions(self, wi, u):
        """Draws wo for wi by numbers u (N, 3) in [0, 1): wo (N, 3), and its density per solid angle (N), 0 of lost samples."""
        return self._of(("brdf",), "it draws no directions").sample(wi, u)

    def pdf(self, wi, wo):
        """The density of sample_directions(), (N)."""
        return self._of(("brdf",), "it draws no directions").pdf(wi, wo)
