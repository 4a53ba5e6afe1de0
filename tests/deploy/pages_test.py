#!/usr/bin/env python3
"""Compares the manual pages, the completion and RUNBOOK.md with what the programs say of themselves.

usage: pages_test.py SOURCE PATINA PATINAD PAGES
"""

import json
import os
import re
import shutil
import subprocess
import sys
import unittest

SOURCE, PATINA, PATINAD, PAGES = (os.path.abspath(path) for path in sys.argv[1:5])
OPTION = re.compile(r"(?<![\w-])(--[a-z][a-z-]*[a-z])")


def run(*words):
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 0, f"{words}: {done.stderr}"
    return done.stdout


def commands_of(text):
    """The commands that the help of patina lists."""
    listed = re.findall(r"^  ([a-z][a-z-]*) {2,}\S", text.split("\nExamples:")[0], re.MULTILINE)
    return [name for name in listed if not name.startswith("-")]


def long_options(text):
    """Options that a help defines: those that start a line."""
    return {name for line in text.splitlines() for name in OPTION.findall(line) if re.match(r" {2,6}(-|--)", line)
            and line.index(name) < 12}


def read(*parts):
    with open(os.path.join(*parts), encoding="utf-8") as file:
        return file.read()


def plain(page):
    """The text of a roff page, without its markup."""
    page = page.replace("\\-", "-").replace("\\(aq", "'").replace("\\(ga", "`").replace("\\(ti", "~").replace("\\(ha", "^")
    return page.replace("\\&", "").replace("\\e", "\\")


class Pages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        # Made in the same step as the pages: to ask for the help of each command again takes ten seconds.
        texts = json.loads(read(PAGES, "help.json"))
        cls.top, cls.daemon = texts["patina"], texts["patinad"]
        cls.help = {name.split()[1]: text for name, text in texts.items() if " " in name}

    def test_help_is_that_of_the_programs(self):
        self.assertEqual(self.top, run(PATINA, "--help"))
        self.assertEqual(self.daemon, run(PATINAD, "--help"))
        self.assertEqual(list(self.help), commands_of(self.top))
        self.assertEqual(self.help["bake"], run(PATINA, "help", "bake"))
        self.assertGreater(len(self.help), 15)
        self.assertIn("--out", long_options(self.help["bake"]))
        self.assertIn("--check-config", long_options(self.daemon))

    def test_every_command_and_option_is_in_the_manual(self):
        page = plain(read(PAGES, "patina.1"))
        sections = dict(re.findall(r"^\.SH PATINA (\S+)\n(.*?)(?=^\.SH )", page, re.MULTILINE | re.DOTALL))
        self.assertEqual(sorted(sections), sorted(name.upper() for name in self.help))
        for name, text in self.help.items():
            for option in long_options(text):
                self.assertRegex(sections[name.upper()], r"(?m)^\.B (-\w, )?" + re.escape(option) + r"(?![\w-])", name)
            # Nothing of what the help says is lost.
            said = set(re.findall(r"[\w/-]{4,}", sections[name.upper()].lower()))
            lost = set(re.findall(r"[\w/-]{4,}", text.lower())) - said - {"options", "positionals", "usage"}
            self.assertEqual(lost, set(), name)
        page = plain(read(PAGES, "patinad.8"))
        for option in long_options(self.daemon):
            self.assertRegex(page, r"(?m)^\.B (-\w, )?" + re.escape(option) + r"( [A-Z:]+)?$")

    def test_every_setting_is_in_the_manual(self):
        page = plain(read(PAGES, "patinad.json.5"))
        names = re.findall(r'^ +"(\w+)": \{"(?:description|enum|type|const|\$ref)', read(SOURCE, "schemas", "config.schema.json"),
                           re.MULTILINE)
        self.assertGreater(len(names), 30)
        for name in set(names) - {"path", "paths", "word", "words"}:
            self.assertRegex(page, r"(?m)^\.B /(\w+/)*" + name + "$")

    @unittest.skipUnless(shutil.which("man"), "there is no man to format the pages with")
    def test_pages_are_clean(self):
        for name in ("patina.1", "patinad.8", "patinad.json.5"):
            done = subprocess.run(["man", "--warnings", "-E", "UTF-8", "-l", os.path.join(PAGES, name)], text=True, check=False,
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, "MANWIDTH": "100"})
            self.assertEqual((done.returncode, done.stderr), (0, ""), name)
            self.assertGreater(len(done.stdout), 1000, name)

    def complete(self, *words):
        script = 'source "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _patina; printf "%s\\n" "${COMPREPLY[@]}"'
        return set(run("bash", "-c", script, "bash", os.path.join(PAGES, "patina.bash"), *words).split())

    def test_completion(self):
        self.assertEqual(self.complete("patina", ""), set(self.help))
        self.assertEqual(self.complete("patina", "val"), {"validate"})
        self.assertEqual(self.complete("patina", "help", "unp"), {name for name in self.help if name.startswith("unp")})
        for name, text in self.help.items():
            self.assertEqual({word for word in self.complete("patina", name, "--")}, long_options(text), name)
        self.assertEqual(self.complete("patina", "bake", "x", "--quality", ""), {"preview", "standard", "reference"})
        self.assertEqual(self.complete("patina", "bake", "x", "--quality", "pre"), {"preview"})
        self.assertEqual(self.complete("/usr/bin/patinad", "--"), long_options(self.daemon))
        self.assertEqual(self.complete("patina", "info", SOURCE + "/READ"), {SOURCE + "/README.md"})

    def check_call(self, words, where):
        """Words of a call of patina or patinad: the command and its options must be there."""
        text = self.daemon
        if words[0] == "patina":
            self.assertIn(words[1], self.help, where)
            text = self.help[words[1]]
        short = set(re.findall(r"(?m)^ {2}(-\w),", text))
        for word in words[1:]:
            if word.startswith("--"):
                self.assertIn(word.split("=")[0], long_options(text), where)
            elif word.startswith("-"):
                self.assertIn(word, short, where)

    def test_commands_of_documents_exist(self):
        calls = 0
        for document in ("deploy/RUNBOOK.md", "README.md"):
            for line in read(SOURCE, document).splitlines():
                code = [line.split("  #")[0]] if line.startswith("    ") else re.findall(r"`([^`]+)`", line)
                for part in code:
                    words = re.split(r"[;&|>]", part.strip().replace("build/release/bin/", ""))[0].split()
                    if len(words) < 2 or words[0] not in ("patina", "patinad") or not re.match(r"[a-z-]", words[1]):
                        continue
                    calls += 1
                    self.check_call(words, f"{document}: {line}")
        self.assertGreater(calls, 30)

    def test_container_file_calls_what_exists(self):
        text = read(SOURCE, "deploy", "Containerfile")
        lists = [json.loads(found) for found in re.findall(r"^(?:ENTRYPOINT|HEALTHCHECK .*CMD) (\[.*\])$", text, re.MULTILINE)]
        self.assertEqual(sorted(words[0] for words in lists), ["patina", "patinad"])
        for words in lists:
            self.check_call(words, "Containerfile")
        for path in re.search(r"^COPY (deploy/.*) deploy/$", text, re.MULTILINE).group(1).split():
            self.assertTrue(os.path.exists(os.path.join(SOURCE, path)), path)
        # What it cuts the list of packages at.
        cut = re.search(r"/\^(# .*?)/,\$d", text).group(1)
        kept, _, dropped = read(SOURCE, "deploy", "packages.txt").partition(cut)
        self.assertIn("python3 ", kept)
        self.assertIn("libgtest-dev", dropped)
        self.assertIn("USER patina\n", text)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
