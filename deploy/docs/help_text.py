"""What the programs' own --help says, as structures: commands, options with their values and choices, notes."""

import re
import subprocess

# An option or positional with its text behind two spaces or on lines of its own.
ENTRY = re.compile(r"^ {2,6}(\S.*?)(?: {2,}(\S.*))?$")
CHOICES = re.compile(r"\{([^{}]*)\}")


class Entry:
    """One option or positional: as it is written, its names, what it takes, and what it does."""

    def __init__(self, written, text):
        # CLI11 writes `-o,--out DIR`, patinad `-o, --out DIR`.
        self.written = re.sub(r"^(-\w),\s*--", r"\1, --", written)
        self.text = text
        self.names = re.findall(r"(?<![\w-])--?[a-zA-Z][\w-]*", self.written.split(" Needs:")[0])
        choices = CHOICES.search(written)
        self.choices = choices.group(1).split(",") if choices else []
        rest = re.sub(r"^(?:--?[\w-]+(?:, )?)+", "", self.written)
        self.takes_value = bool(self.names) and rest.strip() != ""


class Help:
    """One page of help: what it is (the first line), usage, positionals, options and the lines behind them."""

    def __init__(self, text):
        lines = text.rstrip("\n").split("\n")
        self.what = lines[0].rstrip(".")
        self.usage, self.positionals, self.options, self.commands, self.notes = [], [], [], [], []
        section, at = "", 1
        while at < len(lines):
            line = lines[at]
            at += 1
            if line.lower().startswith("usage:") or section == "usage" and line.startswith("       "):
                self.usage.append(re.sub(r"(?i)^(usage: | +)", "", line))
                section = "usage"
            elif line in ("Positionals:", "Options:") or re.fullmatch(r"(Subcommands|Commands of .*):", line):
                section = line.split(":")[0].split(" ")[0].lower()
            elif line == "":
                section = {"usage": "options", "options": "notes" if self.options else "options"}.get(section, section)
                section = "" if section in ("positionals", "subcommands", "commands") else section
                if section == "notes" and self.notes and self.notes[-1] != "":
                    self.notes.append("")
            elif section in ("positionals", "options", "subcommands", "commands") and line.startswith("  "):
                written, said = ENTRY.match(line).groups()
                said = [said] if said else []
                while at < len(lines) and re.match(r" {20,}\S", lines[at]):
                    said.append(lines[at].strip())
                    at += 1
                kind = {"positionals": self.positionals, "options": self.options}.get(section, self.commands)
                kind.append(Entry(written, " ".join(said)))
            else:
                section = "notes"
                self.notes.append(line)
        while self.notes and self.notes[-1] == "":
            self.notes.pop()


def ask(program, *arguments):
    """The text that a program prints."""
    done = subprocess.run([program, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0 or not done.stdout:
        raise SystemExit(f"{program} {' '.join(arguments)}: exit code {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def read_all(patina, patinad):
    """The help of both programs: {"patina": text, "patinad": text, "patina COMMAND": text, ...}, commands in their order."""
    texts = {"patina": ask(patina, "--help"), "patinad": ask(patinad, "--help")}
    for entry in Help(texts["patina"]).commands:
        texts["patina " + entry.written] = ask(patina, "help", entry.written)
    return texts
