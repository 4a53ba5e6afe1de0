"""What the programs load when they start, and what `patina` says without its other half.

usage: startup_test.py PATINA PATINAD PATINA_BAKE
Debian's image library brings some 260 libraries, which take a third of a second to load (and start threads, which a service
that blocks signals must not have): only patina-bake may load it.
"""
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

PATINA, PATINAD, PATINA_BAKE = sys.argv[1:4]


def libraries(program):
    done = subprocess.run([program], env={**os.environ, "LD_TRACE_LOADED_OBJECTS": "1"}, capture_output=True, text=True, check=True)
    return [line.split()[0] for line in done.stdout.splitlines() if line.strip()]


class Startup(unittest.TestCase):
    def test_only_the_bake_program_loads_the_image_library(self):
        for program in (PATINA, PATINAD):
            self.assertLess(len(libraries(program)), 30, program)
            self.assertFalse([name for name in libraries(program) if "OpenImageIO" in name or "OpenColorIO" in name], program)
        self.assertTrue([name for name in libraries(PATINA_BAKE) if "OpenImageIO" in name])

    def test_says_what_is_missing_without_it(self):
        with tempfile.TemporaryDirectory() as folder:
            os.mkdir(folder + "/bin")
            alone = shutil.copy(PATINA, folder + "/bin/patina")
            done = subprocess.run([alone, "bake", folder, "--out", folder + "/out"], capture_output=True, text=True)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("libexec/patina/patina-bake", done.stderr)
            self.assertIn("install patina again", done.stderr)
            self.assertEqual(subprocess.run([alone, "--version"], capture_output=True).returncode, 0)

    def test_is_one_program_to_who_runs_it(self):
        done = subprocess.run([PATINA, "bake", "/nowhere", "--out", "/tmp/out"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 3, done.stderr)
        self.assertTrue(done.stderr.startswith("patina: error: "), done.stderr)
        done = subprocess.run([PATINA_BAKE, "info", "/nowhere"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2, done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
