#!/usr/bin/env python3
"""Compares the files for a running service with a patinad that runs: alerts, board, runbook, unit and accounts.

usage: service_test.py SOURCE PATINA PATINAD
"""

import http.client
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import unittest

import yaml

SOURCE, PATINA, PATINAD = (os.path.abspath(path) for path in sys.argv[1:4])
METRIC = re.compile(r"\bpatina_\w+")


def read(*parts):
    with open(os.path.join(SOURCE, *parts), encoding="utf-8") as file:
        return file.read()


class UnixConnection(http.client.HTTPConnection):
    def __init__(self, path):
        super().__init__("localhost", timeout=60)
        self.path = path

    def connect(self):
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(60)
        self.sock.connect(self.path)


class WithDaemon(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        for name in ("drop", "baked"):
            os.mkdir(os.path.join(cls.folder.name, name))
        place = lambda name: os.path.join(cls.folder.name, name)
        cls.socket = place("sock")
        cls.daemon = subprocess.Popen(
            [PATINAD, "--watch", place("drop"), "--out", place("baked"), "--state", place("state"), "--socket", cls.socket,
             "--worker", PATINA], stderr=subprocess.PIPE, text=True)
        said = ""
        for line in cls.daemon.stderr:
            said += line
            if '"event":"ready"' in line:
                break
        else:
            raise AssertionError(f"patinad ended with {cls.daemon.wait()}: {said}")

    @classmethod
    def tearDownClass(cls):
        cls.daemon.send_signal(signal.SIGTERM)
        cls.daemon.stderr.read()
        code = cls.daemon.wait(timeout=60)
        cls.daemon.stderr.close()
        cls.folder.cleanup()
        assert code == 0, code

    def ask(self, method, path):
        connection = UnixConnection(self.socket)
        connection.request(method, path)
        answer = connection.getresponse()
        body = answer.read().decode()
        connection.close()
        return answer.status, body

    def exported(self):
        """Names of series with their labels' names and values, as patinad serves them."""
        status, text = self.ask("GET", "/metrics")
        self.assertEqual(status, 200)
        names = set(re.findall(r"^# TYPE (\S+) (?:gauge|counter)$", text, re.MULTILINE))
        for name in re.findall(r"^# TYPE (\S+) histogram$", text, re.MULTILINE):
            names |= {name + end for end in ("_bucket", "_sum", "_count")}
        labels = {}
        for name, inside in re.findall(r"^(\w+)\{(.*)\} ", text, re.MULTILINE):
            for label, value in re.findall(r'(\w+)="([^"]*)"', inside):
                labels.setdefault((name, label), set()).add(value)
        return names, labels

    def check_expression(self, expression, names, labels):
        metrics = METRIC.findall(re.sub(r'"[^"]*"', "", expression))
        self.assertTrue(metrics or "up{" in expression, expression)
        self.assertEqual(set(metrics) - names, set(), expression)
        for name, inside in re.findall(r"(\bpatina_\w+)\{([^}]*)\}", expression):
            for label, value in re.findall(r'(\w+)="([^"]*)"', inside):
                self.assertIn(value, labels.get((name, label), set()), expression)
        self.assertEqual(expression.count("("), expression.count(")"), expression)

    def test_alerts_use_what_is_exported(self):
        names, labels = self.exported()
        headings = re.findall(r"^## (.*)$", read("deploy", "RUNBOOK.md"), re.MULTILINE)
        (group,) = yaml.safe_load(read("deploy", "prometheus", "alerts.yml"))["groups"]
        alerts = [rule["alert"] for rule in group["rules"]]
        self.assertEqual(len(set(alerts)), len(alerts))
        for rule in group["rules"]:
            self.check_expression(rule["expr"], names, labels)
            self.assertIn(rule["labels"]["severity"], ("critical", "warning", "info"))
            document, _, part = rule["annotations"]["runbook"].partition(", ")
            self.assertEqual(document, "RUNBOOK.md")
            self.assertIn(part, headings)
        (job,) = yaml.safe_load(read("deploy", "prometheus", "scrape.yml"))["scrape_configs"]
        self.assertEqual(self.ask("GET", job["metrics_path"])[0], 200)
        self.assertIn(f'up{{job="{job["job_name"]}"}}', read("deploy", "prometheus", "alerts.yml"))

    def test_board_uses_what_is_exported(self):
        names, labels = self.exported()
        board = json.loads(read("deploy", "prometheus", "grafana.json"))
        self.assertEqual(len({panel["id"] for panel in board["panels"]}), len(board["panels"]))
        for panel in board["panels"]:
            for target in panel["targets"]:
                self.check_expression(target["expr"], names, labels)
                for label in re.findall(r"\{\{(\w+)\}\}", target["legendFormat"]):
                    self.assertTrue(any(known == label for _, known in labels), (panel["title"], label))

    def test_calls_of_the_runbook_work(self):
        calls = re.findall(r"curl --unix-socket \S+ -X (\w+) http://localhost(\S+)", read("deploy", "RUNBOOK.md"))
        self.assertGreaterEqual(len(calls), 3)
        for method, path in calls:
            status, body = self.ask(method, path)
            self.assertLess(status, 300, f"{method} {path}: {body}")
        for path in re.findall(r"location = (\S+) \{", read("deploy", "reverse-proxy", "nginx.conf")):
            self.assertEqual(self.ask("GET", path)[0], 200, path)


class Files(unittest.TestCase):
    def test_runbook_explains_the_log(self):
        logged = {}
        for folder, _, files in os.walk(os.path.join(SOURCE, "daemon")):
            for name in files:
                if name.endswith(".cpp"):
                    for level, event in re.findall(r'\blog_?(?:\.|->)(Info|Warning|Error)\(\s*"(\w+)"', read(folder, name)):
                        logged.setdefault(event, set()).add(level.lower())
        explained = {}
        for events, levels in re.findall(r"^\| (`.*?) \| ([a-z, ]+) \|", read("deploy", "RUNBOOK.md"), re.MULTILINE):
            for event in re.findall(r"`(\w+)`", events):
                explained[event] = set(levels.split(", "))
        self.assertGreater(len(logged), 15)
        self.assertEqual(sorted(explained), sorted(logged))
        for event, levels in logged.items():
            self.assertLessEqual(levels, explained[event], event)

    def test_unit_accounts_and_folders_agree(self):
        unit = read("deploy", "systemd", "patinad.service")
        account = re.search(r"^User=(\w+)$", unit, re.MULTILINE).group(1)
        self.assertRegex(read("deploy", "systemd", "patina.sysusers.conf"), rf"(?m)^u {account} ")
        made = dict(re.findall(r"^d (\S+) +(\d+) " + f"{account} {account}$",
                               read("deploy", "systemd", "patina.tmpfiles.conf"), re.MULTILINE))
        config = json.loads(read("deploy", "systemd", "patinad.json"))
        for path in [config["state_dir"], config["out"]] + [root["path"] for root in config["watch"]]:
            self.assertIn(path, made)
        self.assertEqual(made[config["state_dir"]], re.search(r"StateDirectoryMode=(\d+)", unit).group(1))
        (conffile,) = read("deploy", "debian", "conffiles").split()
        self.assertIn(f"--config {conffile}\n", unit)
        proxy = read("deploy", "reverse-proxy", "patina-proxy.service")
        self.assertIn(f" {config['state_dir']}/patinad.sock\n", proxy)
        listen = re.search(r"ListenStream=(\S+)", read("deploy", "reverse-proxy", "patina-proxy.socket")).group(1)
        self.assertIn(f"server unix:{listen};", read("deploy", "reverse-proxy", "nginx.conf"))

    def test_maintainer_scripts_are_shell(self):
        for name in ("postinst", "prerm", "postrm"):
            done = subprocess.run(["sh", "-n", os.path.join(SOURCE, "deploy", "debian", name)], check=False)
            self.assertEqual(done.returncode, 0, name)
            self.assertTrue(os.access(os.path.join(SOURCE, "deploy", "debian", name), os.X_OK), name)

    @unittest.skipUnless(shutil.which("nginx"), "there is no nginx to read its configuration")
    @unittest.skipUnless(shutil.which("openssl"), "there is no openssl to make a certificate")
    def test_nginx_reads_its_configuration(self):
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=x", "-days", "1", "-keyout",
                            folder + "/privkey.pem", "-out", folder + "/fullchain.pem"], check=True, capture_output=True)
            with open(folder + "/tokens", "w", encoding="utf-8") as file:
                file.write('"Bearer 0123456789abcdef" 1;\n')
            site = read("deploy", "reverse-proxy", "nginx.conf").replace("/etc/ssl/patina/", folder + "/")
            site = site.replace("/etc/nginx/patina.tokens", folder + "/tokens")
            with open(folder + "/nginx.conf", "w", encoding="utf-8") as file:
                file.write(f"pid {folder}/pid; error_log stderr;\nevents {{}}\nhttp {{\naccess_log off;\n{site}\n}}\n")
            done = subprocess.run(["nginx", "-t", "-c", folder + "/nginx.conf"], capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
