#!/usr/bin/env python3
"""Lints the recipes of deploy/ci: usage: ci_test.py DEPLOY_CI PATINA

Each must be YAML of the shape its system wants, and each command line of `patina` in it is run, in a folder without any
containers: it must be understood (any exit code but 2, wrong usage), and write the report that the recipe names.
"""

import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

import yaml

FOLDER, PATINA = sys.argv[1], os.path.abspath(sys.argv[2])


def load(name):
    with open(os.path.join(FOLDER, name), encoding="utf-8") as file:
        return yaml.safe_load(file)


def patina_lines(lines):
    """The arguments of each call of patina in lines of shell."""
    for line in lines:
        # What follows `||` is for the shell.
        words = shlex.split(line.split("||")[0])
        if words and os.path.basename(words[0]) == "patina":
            yield words[1:]


class Recipes(unittest.TestCase):
    def check_commands(self, lines, least):
        """Runs each call in a folder with a broken container; returns that folder."""
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        os.makedirs(os.path.join(folder.name, "baked", "wall"))
        with open(os.path.join(folder.name, "baked", "wall", "manifest.json"), "w", encoding="utf-8") as file:
            file.write("{}")
        calls = list(patina_lines(lines))
        self.assertGreaterEqual(len(calls), least, lines)
        for arguments in calls:
            done = subprocess.run([PATINA] + arguments, cwd=folder.name, capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 1, f"{arguments}: {done.stderr}")
        return folder.name

    def test_every_recipe_is_tested(self):
        self.assertEqual(sorted(os.listdir(FOLDER)), ["github-actions.yml", "gitlab-ci.yml", "pre-commit-config.yaml"])

    def test_github_actions(self):
        recipe = load("github-actions.yml")
        self.assertIn("push", recipe[True])  # YAML 1.1 reads the key `on` as true
        self.assertEqual(recipe["permissions"]["security-events"], "write")
        lines, uploads = [], []
        for job in recipe["jobs"].values():
            self.assertIn("runs-on", job)
            for step in job["steps"]:
                self.assertEqual(("run" in step) + ("uses" in step), 1, step)
                lines += step.get("run", "").splitlines()
                if step.get("uses", "").startswith("github/codeql-action/upload-sarif@"):
                    uploads.append(step["with"]["sarif_file"])
        folder = self.check_commands(lines, 2)
        self.assertEqual(len(uploads), 1)
        with open(os.path.join(folder, uploads[0]), encoding="utf-8") as file:
            sarif = json.load(file)
        self.assertEqual(sarif["version"], "2.1.0")
        run = sarif["runs"][0]
        rules = [rule["id"] for rule in run["tool"]["driver"]["rules"]]
        self.assertEqual(rules, sorted(set(rules)))
        self.assertGreater(len(run["results"]), 0)
        for result in run["results"]:
            self.assertEqual(rules[result["ruleIndex"]], result["ruleId"])
            self.assertIn(result["level"], ("error", "warning", "note"))
            place = result["locations"][0]["physicalLocation"]["artifactLocation"]
            self.assertEqual(place["uri"], "baked/wall/manifest.json")

    def test_gitlab(self):
        recipe = load("gitlab-ci.yml")
        jobs = {name: job for name, job in recipe.items() if isinstance(job, dict)}
        self.assertEqual(list(jobs), ["validate-assets"])
        job = jobs["validate-assets"]
        self.assertIn(job["stage"], recipe["stages"])
        folder = self.check_commands(job["script"] + job["after_script"], 2)
        report = xml.etree.ElementTree.parse(os.path.join(folder, job["artifacts"]["reports"]["junit"])).getroot()
        self.assertEqual(report.tag, "testsuites")
        case = report.find("testsuite/testcase")
        self.assertEqual((case.get("classname"), case.get("name")), ("patina.container", "baked/wall"))
        self.assertIn("PAT-", case.find("failure").get("message"))
        for path in job["artifacts"]["paths"]:
            with open(os.path.join(folder, path), encoding="utf-8") as file:
                self.assertFalse(json.load(file)["valid"])

    def test_pre_commit(self):
        (repo,) = load("pre-commit-config.yaml")["repos"]
        (hook,) = repo["hooks"]
        self.assertEqual(repo["repo"], "local")
        for key in ("id", "name", "language", "entry", "files"):
            self.assertIn(key, hook)
        files = re.compile(hook["files"])
        for name in ("manifest.json", "baked/wall/r0001/manifest.json", "wall.patina", "a.patina.json", "a.scene.json"):
            self.assertTrue(files.search(name), name)
        for name in ("package.json", "my_manifest.json", "patina.cpp"):
            self.assertFalse(files.search(name), name)
        self.check_commands([hook["entry"] + " baked/wall/manifest.json"], 1)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
