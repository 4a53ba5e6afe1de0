"""The Python package as its users see it: what it decodes is what the program says, and its errors help.

usage: python_test.py PACKAGE_FOLDER PATINA
"""
import json
import os
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

try:
    import numpy
except ImportError:
    print("skipped: numpy is not installed")
    sys.exit(77)

sys.path.insert(0, sys.argv[1])
os.environ["PATINA"] = PATINA = sys.argv[2]
import patina  # noqa: E402


def directions(rng, count):
    vectors = rng.normal(size=(count, 3)).astype(numpy.float32)
    vectors[:, 2] = numpy.abs(vectors[:, 2]) + 0.05
    return vectors / numpy.linalg.norm(vectors, axis=1, keepdims=True)


def png(path):
    """An 8-bit RGB or grey file without interlacing, (H, W, channels)."""
    with open(path, "rb") as file:
        data = file.read()
    at, packed = 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            width, height, depth, color = struct.unpack(">IIBB", data[at + 8:at + 18])
            assert depth == 8 and color in (0, 2)
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + size]
        at += 12 + size
    step = 3 if color == 2 else 1
    raw, stride = zlib.decompress(packed), width * step
    image = numpy.zeros((height, stride), numpy.int32)
    for y in range(height):
        kind, row = raw[y * (stride + 1)], raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)]
        for i, value in enumerate(row):
            left = image[y, i - step] if i >= step else 0
            up = image[y - 1, i] if y else 0
            corner = image[y - 1, i - step] if y and i >= step else 0
            guess = left + up - corner
            paeth = min((left, up, corner), key=lambda near: abs(guess - near))
            image[y, i] = (value + (0, left, up, (left + up) // 2, paeth)[kind]) & 255
    return image.reshape(height, width, step)


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.root = cls.folder.name
        subprocess.run([PATINA, "sample", "--out", cls.root + "/wall", "--size", "64", "-q"], check=True)
        cls.material, = patina.bake(cls.root + "/wall", out=cls.root + "/baked", quality="preview", samples=200000)
        subprocess.run([PATINA, "sample", "--kind", "btf", "--out", cls.root + "/cloth", "--size", "16", "--images", "9", "-q"], check=True)
        with open(cls.root + "/cloth.json", "w", encoding="utf-8") as file:
            # A model that is learned in a second.
            json.dump({"version": 1, "kind": "svbrdf", "asset": "cloth", "file": "cloth/bumps.btf.json", "out": "baked",
                       "quality": "preview", "model": {"nside": 4, "hidden": 32, "textures": 2}}, file)
        cls.svbrdf, = patina.bake(cls.root + "/cloth.json", out=cls.root + "/baked")
        cls.brdf, = patina.bake(cls.root + "/wall/brdf/sparse.csv", out=cls.root + "/baked", quality="preview")

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_decodes_every_map_of_every_mip(self):
        self.assertEqual(self.material.kind, "material")
        self.assertEqual(self.material.size, (64, 64))
        for level in range(self.material.levels):
            maps = self.material.decode(level)
            side = max(1, 64 >> level)
            self.assertEqual(maps["albedo"].shape, (side, side, 3))
            self.assertEqual(maps["normal"].shape, (side, side, 3))
            self.assertEqual(maps["roughness"].shape, (side, side))
            for values in maps.values():
                self.assertEqual(values.dtype, numpy.float32)
                self.assertTrue(numpy.isfinite(values).all())
            self.assertTrue(numpy.allclose(numpy.linalg.norm(maps["normal"], axis=-1), 1, atol=0.2))

    def test_has_the_quality_that_the_manifest_states(self):
        source = png(self.root + "/wall/" + "mosaic_floor_basecolor.png")
        decoded = self.material.decode(coded=True)["albedo"]
        psnr = -10 * numpy.log10(numpy.mean((decoded - source / 255.0) ** 2))
        stated = next(entry for entry in self.material.manifest["quality"]["maps"] if entry["map"] == "albedo")["mips"][0]
        self.assertAlmostEqual(psnr, stated["psnr_db"], delta=0.02)

    def test_samples_agree_with_decoding_at_texel_centres(self):
        coded = self.material.decode(level=1, coded=True)
        y, x = numpy.mgrid[0:32, 0:32]
        uv = numpy.column_stack([(x.ravel() + 0.5) / 32, (y.ravel() + 0.5) / 32])
        sampled = self.material.sample(uv, lod=1, coded=True)
        for name, values in coded.items():
            numpy.testing.assert_allclose(sampled[name].reshape(values.shape), values, atol=1e-5)

    def evaluated(self, container, *columns):
        """What the program says."""
        pairs = self.root + "/pairs.csv"
        numpy.savetxt(pairs, numpy.column_stack(columns), delimiter=",", fmt="%.9g")
        text = subprocess.run([PATINA, "eval", container.path, "--pairs", pairs], check=True, capture_output=True, text=True).stdout
        return numpy.array([[float(word) for word in line.split(",")] for line in text.splitlines()])

    def test_brdfs_agree_with_the_program(self):
        rng = numpy.random.default_rng(1)
        wi, wo = directions(rng, 50), directions(rng, 50)
        f = self.brdf.evaluate(wi, wo)
        numpy.testing.assert_allclose(f, self.evaluated(self.brdf, wi, wo), rtol=1e-4, atol=1e-6)

    def test_brdfs_that_vary_agree_with_the_program(self):
        self.assertEqual((self.svbrdf.kind, self.svbrdf.size, self.svbrdf.levels), ("svbrdf", (16, 16), 5))
        rng = numpy.random.default_rng(3)
        wi, wo = directions(rng, 50), directions(rng, 50)
        uv = rng.uniform(-2, 2, (50, 2)).astype(numpy.float32)
        lod = rng.uniform(0, 4, 50).astype(numpy.float32)
        f = self.svbrdf.evaluate(wi, wo, uv, lod)
        self.assertEqual(f.shape, (50, 3))
        numpy.testing.assert_allclose(f, self.evaluated(self.svbrdf, wi, wo, uv, lod), rtol=1e-4, atol=1e-6)
        finest = self.svbrdf.evaluate(wi, wo, uv)
        numpy.testing.assert_allclose(finest, self.evaluated(self.svbrdf, wi, wo, uv), rtol=1e-4, atol=1e-6)
        numpy.testing.assert_array_equal(finest, self.svbrdf.evaluate(wi, wo, uv, lod=0))
        self.assertFalse(numpy.array_equal(finest, f))

    def test_draws_directions_with_their_density(self):
        rng = numpy.random.default_rng(2)
        wi = numpy.tile(numpy.float32([0.6, 0, 0.8]), (2000, 1))
        wo, pdf = self.brdf.sample_directions(wi, rng.random((2000, 3), dtype=numpy.float32))
        kept = pdf > 0
        self.assertGreater(kept.mean(), 0.8)
        numpy.testing.assert_allclose(self.brdf.pdf(wi[kept], wo[kept]), pdf[kept], rtol=1e-3)
        albedo = (self.brdf.evaluate(wi[kept], wo[kept])[:, 1] * wo[kept, 2] / pdf[kept]).sum() / len(wi)
        self.assertTrue(0 < albedo < 1.5, albedo)

    def test_says_what_is_wrong(self):
        with self.assertRaises(patina.BakeError) as caught:
            patina.bake(self.root + "/nothing", out=self.root + "/baked")
        self.assertEqual(caught.exception.exit_code, 3)
        self.assertIn("nothing", str(caught.exception))
        with self.assertRaises(FileNotFoundError):
            patina.Container(self.root + "/nothing")
        with self.assertRaisesRegex(TypeError, "evaluate"):
            self.brdf.decode()
        with self.assertRaises(TypeError):
            self.material.evaluate(numpy.zeros((1, 3)), numpy.zeros((1, 3)))
        with self.assertRaisesRegex(IndexError, "mips 0 to 6"):
            self.material.decode(level=7)
        with self.assertRaisesRegex(ValueError, "rows of 3"):
            self.brdf.evaluate(numpy.zeros((4, 2)), numpy.zeros((4, 3)))
        with self.assertRaisesRegex(ValueError, "as many rows"):
            self.brdf.evaluate(numpy.zeros((4, 3)), numpy.zeros((5, 3)))
        with self.assertRaisesRegex(ValueError, "row 1 is not finite"):
            self.material.sample([[0, 0], [float("nan"), 0]])
        one = numpy.float32([[0, 0, 1]])
        with self.assertRaisesRegex(TypeError, "needs uv"):
            self.svbrdf.evaluate(one, one)
        with self.assertRaisesRegex(TypeError, "takes no uv"):
            self.brdf.evaluate(one, one, [[0, 0]])
        with self.assertRaisesRegex(ValueError, "as many rows"):
            self.svbrdf.evaluate(one, one, [[0, 0], [1, 1]])
        with self.assertRaisesRegex(ValueError, "rows of 2"):
            self.svbrdf.evaluate(one, one, [0, 0])
        with self.assertRaisesRegex(ValueError, "row 0 is not finite"):
            self.svbrdf.evaluate(one, one, [[0, 0]], lod=float("inf"))
        with self.assertRaisesRegex(TypeError, "evaluate"):
            self.svbrdf.decode()
        with self.assertRaisesRegex(TypeError, "draws no directions"):
            self.svbrdf.sample_directions(one, one)
        with open(self.brdf.path + "/manifest.json", encoding="utf-8") as file:
            self.assertEqual(json.load(file), self.brdf.manifest)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
