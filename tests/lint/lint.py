#!/usr/bin/env python3
"""Checks the source tree against the rules of CONTRIBUTING.md that a machine can check.

usage: lint.py ROOT

Prints one line for each finding, `path:line: rule: message`, and exits with 1 if there is any. Each rule is a function
of (tree, report); lint_test.py shows each of them a tree that breaks it.
"""

import json
import os
import re
import subprocess
import sys

# The layers, lowest first. A file may include its own layer and those below it.
TOP_LAYERS = {"schemas": 0, "formats": 1, "pipeline": 2, "daemon": 3}
# The modules of pipeline/ in tiers: a module may include its own files and those of lower tiers.
PIPELINE_TIERS = {
    "base": 0,
    "kernels": 1,
    "bc6": 2, "color": 2, "effects": 2, "healpix": 2, "image": 2, "metrics": 2, "nn": 2,
    "brdf": 3, "layered": 3, "material": 3, "report": 3,
    "svbrdf": 4,
    "jobs": 5,
    "client": 6, "tradeoff": 6, "validate": 6,
    "cli": 7,
}
# The same of daemon/; what lies directly in it (main.cpp) may use all of them.
DAEMON_TIERS = {
    "base": 0,
    "config": 1, "execute": 1, "queue": 1,
    "service": 2,
    "api": 3, "watch": 3,
    "view": 4,
}
MODULE_TIERS = {"pipeline": PIPELINE_TIERS, "daemon": DAEMON_TIERS}
# Includes between modules of one tier, as (from, to).
SAME_TIER_ALLOWED = {("image", "color"), ("metrics", "color")}

# Headers that cost seconds of compile time or leak macros: each in one .cpp of ours, and in no header.
HEAVY_HEADERS = {
    "CLI11": r"CLI/",
    "OpenColorIO": r"OpenColorIO/",
    "OpenImageIO": r"OpenImageIO/",
    "OpenSSL": r"openssl/",
    "cpp-httplib": r"httplib\.h",
    "SQLite": r"sqlite3\.h",
    "valijson": r"valijson/",
}
# Standard headers that g++ 12 and clang 14 do not both have.
MISSING_HEADERS = {"expected", "format", "generator", "mdspan", "print", "ranges", "source_location", "stacktrace"}

# Headers that users copy, however long. Their tests, as users do, and they themselves include them by their bare names.
STANDALONE = {"formats/decoder/patina_brdf_decoder.h", "formats/decoder/patina_brdf_sampler.h",
              "formats/decoder/patina_decoder.h", "formats/decoder/patina_svbrdf_decoder.h"}

MAX_LINES = 800
CPP_SUFFIXES = (".h", ".cpp", ".inl")
CODE_SUFFIXES = CPP_SUFFIXES + (".py", ".sh", ".cmake", ".glsl", ".hlsl")
SKIPPED_FOLDERS = {".git", "build", "out", "__pycache__"}

# Absolute paths of a particular machine. Written in two parts so that this file does not contain them.
MACHINE_PATH = re.compile(r"(?<![\w.$})\]*-])/(?:" + "|".join(["wor" + "k", "roo" + "t", "hom" + "e", "User" + "s"]) + r")/\w")
UNFINISHED = re.compile(r"\b(TO" + "DO|FIX" + r"ME)\b")
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
COMMENT_OR_STRING = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.DOTALL)


class Tree:
    """The files of a source tree: what git tracks or would track, else everything but build output."""

    def __init__(self, root):
        self.root = root
        self.paths = sorted(self._from_git() or self._from_walk())

    def _from_git(self):
        if not os.path.exists(os.path.join(self.root, ".git")):
            return []
        try:
            listed = subprocess.run(
                ["git", "-C", self.root, "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True).stdout
        except (OSError, subprocess.CalledProcessError):
            return []
        paths = {name for name in listed.decode("utf-8", "surrogateescape").split("\0") if name}
        return [path for path in paths if os.path.isfile(os.path.join(self.root, path))]

    def _from_walk(self):
        found = []
        for folder, folders, files in os.walk(self.root):
            folders[:] = [name for name in folders if name not in SKIPPED_FOLDERS]
            found += [os.path.relpath(os.path.join(folder, name), self.root) for name in files]
        return found

    def text(self, path):
        """The content of a text file; None if it is not text."""
        with open(os.path.join(self.root, path), "rb") as file:
            content = file.read()
        if b"\0" in content:
            return None
        return content.decode("utf-8", "replace")

    def cpp(self, *tops):
        """C++ files under the named top folders (all of them if none is named)."""
        return [path for path in self.paths
                if path.endswith(CPP_SUFFIXES) and (not tops or path.split("/")[0] in tops)]

    def includes(self, path):
        """(line number, is quoted, name) of each #include."""
        for number, line in enumerate(self.text(path).splitlines(), 1):
            match = INCLUDE.match(line)
            if match:
                yield number, match.group(1) == '"', match.group(2)


def code_only(text):
    """The text with comments, strings and character literals blanked, line breaks kept."""
    return COMMENT_OR_STRING.sub(lambda match: re.sub(r"[^\n]", " ", match.group()), text)


def include_direction(tree, report):
    for path in tree.cpp():
        parts = path.split("/")
        for number, quoted, name in tree.includes(path):
            if not quoted:
                continue
            if (parts[0] == "tests" or path in STANDALONE) and name in {os.path.basename(header) for header in STANDALONE}:
                continue
            if not os.path.isfile(os.path.join(tree.root, name)):
                report(path, number, f'"{name}" is not a path from the project root')
                continue
            target = name.split("/")
            if parts[0] not in TOP_LAYERS:
                continue
            if target[0] not in TOP_LAYERS:
                report(path, number, f"{parts[0]} may not include {target[0]}")
            elif TOP_LAYERS[target[0]] > TOP_LAYERS[parts[0]]:
                report(path, number, f"{parts[0]} may not include {target[0]}: it is a higher layer")
            elif parts[0] == target[0] and parts[0] in MODULE_TIERS and len(parts) > 2 and parts[1] != target[1]:
                top, tiers = parts[0], MODULE_TIERS[parts[0]]
                from_tier, to_tier = tiers.get(parts[1]), tiers.get(target[1])
                if from_tier is None or to_tier is None:
                    unknown = parts[1] if from_tier is None else target[1]
                    report(path, number, f"{top}/{unknown} has no tier: add it to lint.py and CONTRIBUTING.md")
                elif to_tier > from_tier:
                    report(path, number, f"{top}/{parts[1]} may not include {top}/{target[1]}: it is a higher tier")
                elif to_tier == from_tier and (parts[1], target[1]) not in SAME_TIER_ALLOWED:
                    report(path, number, f"{top}/{parts[1]} may not include {top}/{target[1]}: same tier")


def heavy_headers(tree, report):
    first_user = {}
    for path in tree.cpp(*TOP_LAYERS):
        for number, _, name in tree.includes(path):
            for library, pattern in HEAVY_HEADERS.items():
                if not re.match(pattern, name):
                    continue
                if not path.endswith(".cpp"):
                    report(path, number, f"a header may not include {library}: wrap it in one .cpp")
                elif first_user.setdefault(library, path) != path:
                    report(path, number, f"{library} is already wrapped by {first_user[library]}: use that")


def missing_headers(tree, report):
    for path in tree.cpp():
        for number, quoted, name in tree.includes(path):
            if not quoted and name in MISSING_HEADERS:
                report(path, number, f"<{name}> is not in both g++ 12 and clang 14")


def no_throw(tree, report):
    for path in tree.cpp(*TOP_LAYERS):
        for number, line in enumerate(code_only(tree.text(path)).splitlines(), 1):
            # std::bad_alloc is what `new` throws; an allocator of ours does the same. Python's errors are exceptions: those of
            # pybind11 are how they are raised.
            if re.search(r"\bthrow\b(?!\s+std::bad_alloc\b)(?!\s+(py|pybind11)::)", line):
                report(path, number, "we throw no exceptions: return a Result")


def no_sleep_in_tests(tree, report):
    for path in tree.cpp("tests"):
        for number, line in enumerate(code_only(tree.text(path)).splitlines(), 1):
            if re.search(r"\b(sleep_for|sleep_until|usleep|nanosleep|sleep)\s*\(", line):
                report(path, number, "a test may not sleep: wait for the event itself")


def machine_paths(tree, report):
    for path in tree.paths:
        text = tree.text(path)
        for number, line in enumerate((text or "").splitlines(), 1):
            if MACHINE_PATH.search(line):
                report(path, number, "an absolute path of one machine")


def unfinished(tree, report):
    for path in tree.paths:
        text = tree.text(path)
        for number, line in enumerate((text or "").splitlines(), 1):
            if UNFINISHED.search(line):
                report(path, number, "unfinished work is an issue, not a comment")


def file_length(tree, report):
    for path in tree.paths:
        if not path.endswith(CODE_SUFFIXES) or path in STANDALONE:
            continue
        lines = len((tree.text(path) or "").splitlines())
        if lines > MAX_LINES:
            report(path, lines, f"{lines} lines: split files over {MAX_LINES}")


def schemas_are_json(tree, report):
    def refuse_duplicates(pairs):
        keys = [key for key, _ in pairs]
        for key in keys:
            if keys.count(key) > 1:
                raise ValueError(f"duplicate key {key!r}")
        return dict(pairs)

    for path in tree.paths:
        # Examples of invalid files may break any rule.
        if not path.startswith("schemas/") or not path.endswith(".json") or "/invalid/" in path:
            continue
        try:
            content = json.loads(tree.text(path) or "", object_pairs_hook=refuse_duplicates)
        except ValueError as error:
            report(path, getattr(error, "lineno", 1), f"not JSON: {error}")
            continue
        if path.endswith(".schema.json"):
            dialect = content.get("$schema", "") if isinstance(content, dict) else ""
            if dialect.rstrip("#") != "http://json-schema.org/draft-07/schema":
                report(path, 1, f"$schema is {dialect!r}: schemas are draft-07")


RULES = [include_direction, heavy_headers, missing_headers, no_throw, no_sleep_in_tests, machine_paths, unfinished,
         file_length, schemas_are_json]


def lint(root):
    """All findings as (path, line, rule, message), sorted."""
    tree = Tree(root)
    findings = []
    for rule in RULES:
        rule(tree, lambda path, line, message: findings.append((path, line, rule.__name__, message)))
    return sorted(findings), len(tree.paths)


def main():
    if len(sys.argv) != 2 or not os.path.isdir(sys.argv[1]):
        print(__doc__.strip(), file=sys.stderr)
        return 2
    findings, files = lint(sys.argv[1])
    for path, line, rule, message in findings:
        print(f"{path}:{line}: {rule}: {message}")
    print(f"{files} files, {len(RULES)} rules, {len(findings)} findings")
    if files == 0:
        print("nothing was checked: is this the source tree?", file=sys.stderr)
    return 1 if findings or files == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
