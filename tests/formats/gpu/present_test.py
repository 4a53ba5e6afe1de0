#!/usr/bin/env python3
"""Fails if the tests of the shaders were left out of the build although the packages that they need are installed.

usage: present_test.py FOLDER_OF_PROGRAMS

The programs themselves fail, rather than skip, where an installed driver does not work.
"""

import os
import subprocess
import sys

NEEDS = {
    "formats_gpu_gl_test": ["libegl-dev", "libgl-dev", "libgl1-mesa-dri"],
    "formats_gpu_vulkan_test": ["libegl-dev", "libgl-dev", "libvulkan-dev", "mesa-vulkan-drivers", "glslang-tools"],
}


def installed(package):
    done = subprocess.run(["dpkg-query", "-W", "-f=${db:Status-Status}", package], stdout=subprocess.PIPE,
                          stderr=subprocess.DEVNULL, check=False)
    return done.returncode == 0 and done.stdout.startswith(b"installed")


def main():
    wrong = 0
    for program, packages in NEEDS.items():
        missing = [package for package in packages if not installed(package)]
        built = os.access(os.path.join(sys.argv[1], program), os.X_OK)
        if missing:
            print(f"{program}: skipped, not installed: {', '.join(missing)}")
        elif not built:
            print(f"{program}: not built, although everything it needs is installed; configure again")
            wrong = 1
    return wrong


sys.exit(main())
