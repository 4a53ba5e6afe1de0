#!/usr/bin/env python3
"""Makes the manual pages and the completion of bash from what the programs say of themselves.

usage: make_docs.py --patina FILE --patinad FILE --schema config.schema.json --out FOLDER

Written are patina.1, patinad.8, patinad.json.5, patina.bash, and help.json, the texts that they were made from. The same
programs give the same bytes.
"""

import argparse
import json
import os
import shlex

import help_text


def roff(text):
    """Text as roff takes it: nothing in it is a request or an escape."""
    text = text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq").replace("`", "\\(ga").replace("~", "\\(ti")
    return text.replace("^", "\\(ha")


def paragraph(text):
    line = roff(text)
    return ("\\&" if line.startswith((".", "\\(aq")) else "") + line + "\n"


def preformatted(lines):
    return ".nf\n" + "".join(paragraph(line) if line else "\n" for line in lines) + ".fi\n"


def entries(kind):
    return "".join(f".TP\n.B {roff(entry.written)}\n{paragraph(entry.text)}" for entry in kind)


def header(name, section, what, version):
    return (f'.\\" Made by deploy/docs/make_docs.py from --help.\n.TH {name.upper()} {section} "" "patina {version}" '
            f'"Patina"\n.SH NAME\n{name} \\- {roff(what)}\n')


def patina_page(top, commands, version):
    page = header("patina", 1, "bakes materials and BRDFs into small neural materials", version)
    page += ".SH SYNOPSIS\n.B patina\n.I COMMAND\n[\n.I OPTION\n\\&...] [\n.I ARGUMENT\n\\&...]\n"
    page += ".SH DESCRIPTION\n" + paragraph(top.what + ".") + ".SH OPTIONS\n" + entries(top.options) + ".SH COMMANDS\n"
    page += entries(top.commands)
    for name, said in commands:
        usage = said.usage[0].partition(" ")[2]
        page += f".SH PATINA {roff(name.upper())}\n.B patina {roff(name)}\n{paragraph(usage)}.PP\n{paragraph(said.what + '.')}"
        page += entries(said.positionals) + entries(said.options)
        if said.notes:
            page += ".PP\n" + preformatted(said.notes)
    page += ".SH NOTES\n" + preformatted(top.notes)
    return page + ".SH SEE ALSO\n.BR patinad (8),\n.BR patinad.json (5),\n.I /usr/share/doc/patina/\n"


def patinad_page(top, version):
    page = header("patinad", 8, "bakes what is put into a folder, and what is submitted to it", version) + ".SH SYNOPSIS\n"
    page += "".join((".br\n" if number else "") + f".B {roff(usage)}\n" for number, usage in enumerate(top.usage))
    page += ".SH DESCRIPTION\n" + paragraph(top.what + ".") + ".SH OPTIONS\n" + entries(top.options)
    page += ".SH NOTES\n" + preformatted(top.notes) + ".SH FILES\n"
    for path, what in (("/etc/patina/patinad.json", "Configuration of the service patinad.service."),
                       ("/srv/patina/drop, /srv/patina/baked", "Its drop folder, and where its containers go."),
                       ("/var/lib/patina", "Its queue, logs and socket.")):
        page += f".TP\n.I {roff(path)}\n{paragraph(what)}"
    return page + (".SH SEE ALSO\n.BR patina (1),\n.BR patinad.json (5),\n.I /usr/share/doc/patina/RUNBOOK.md\n")


def settings(schema, definitions, prefix):
    """(JSON pointer, schema) of each setting, depth first."""
    for name, part in schema.get("properties", {}).items():
        pointer = f"{prefix}/{name}"
        if "$ref" in part:
            part = {**definitions[part["$ref"].rsplit("/", 1)[1]], **part}
        yield pointer, part
        yield from settings(part, definitions, pointer)
        yield from settings(part.get("items", {}), definitions, pointer + "/N")


def setting_text(part):
    said = [part["description"]] if "description" in part else []
    kind = part.get("type", "")
    if "enum" in part:
        said.append("One of: " + ", ".join(json.dumps(value) for value in part["enum"]) + ".")
    elif "const" in part:
        said.append(f"Always {json.dumps(part['const'])}.")
    elif kind in ("integer", "number"):
        said.append(f"{kind.capitalize()} from {part['minimum']} to {part['maximum']}.")
    elif kind:
        said.append({"string": "Text.", "array": "List.", "object": "Object."}.get(kind, kind.capitalize() + "."))
    if "default" in part:
        said.append(f"Default: {json.dumps(part['default'])}.")
    return " ".join(said)


def config_page(schema, version):
    page = header("patinad.json", 5, "configuration of patinad", version) + ".SH DESCRIPTION\n"
    page += paragraph(schema["description"]) + paragraph(
        "The file is a JSON object. Below are its members by JSON pointer; N is a place in a list. Members that are not here "
        "are errors. `patinad --check-config --config FILE` says all that is wrong, `patinad --print-config --config FILE` "
        "prints what is in effect.")
    page += ".SH MEMBERS\n"
    for pointer, part in settings(schema, schema["definitions"], ""):
        page += f".TP\n.B {roff(pointer)}\n{paragraph(setting_text(part))}"
    page += ".SH EXAMPLE\n" + preformatted([
        "{", '  "version": 1,', '  "state_dir": "/var/lib/patina",', '  "out": "/srv/patina/baked",',
        '  "watch": [{"path": "/srv/patina/drop"}]', "}"])
    return page + ".SH SEE ALSO\n.BR patinad (8)\n"


COMPLETION = """# Completion of bash for patina and patinad. Made by deploy/docs/make_docs.py from --help.

declare -gA _patina_options=(
%(options)s)
declare -gA _patina_values=(
%(values)s)

_patina() {
  local word="${COMP_WORDS[COMP_CWORD]}" before="${COMP_WORDS[COMP_CWORD-1]}" command= program="${COMP_WORDS[0]##*/}"
  local key i
  COMPREPLY=()
  if [[ "$program" == patinad ]]; then
    command=patinad
  else
    for ((i = 1; i < COMP_CWORD; ++i)); do
      if [[ "${COMP_WORDS[i]}" != -* ]]; then
        command="${COMP_WORDS[i]}"
        break
      fi
    done
  fi
  key="$command $before"
  if [[ -n "${_patina_values[$key]+set}" ]]; then
    # A value: one of those that there are, or a name of a file.
    if [[ -n "${_patina_values[$key]}" ]]; then
      mapfile -t COMPREPLY < <(compgen -W "${_patina_values[$key]}" -- "$word")
    else
      mapfile -t COMPREPLY < <(compgen -f -- "$word")
    fi
  elif [[ "$word" == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "${_patina_options[${command:-_}]}" -- "$word")
  elif [[ -z "$command" || "$command" == help ]]; then
    mapfile -t COMPREPLY < <(compgen -W "%(commands)s" -- "$word")
  else
    mapfile -t COMPREPLY < <(compgen -f -- "$word")
  fi
}
complete -o filenames -F _patina patina patinad
"""


def completion(patina, commands, patinad):
    options, values = "", ""
    for name, said in [("_", patina)] + commands + [("patinad", patinad)]:
        names = sorted(word for entry in said.options for word in entry.names)
        options += f"  [{name}]={shlex.quote(' '.join(names))}\n"
        for entry in said.options:
            for word in entry.names if entry.takes_value else []:
                values += f"  [{shlex.quote(name + ' ' + word)}]={shlex.quote(' '.join(entry.choices))}\n"
    return COMPLETION % {"options": options, "values": values, "commands": " ".join(name for name, _ in commands)}


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("usage: ")[1].split("\n")[0])
    for name in ("patina", "patinad", "schema", "out"):
        parser.add_argument("--" + name, required=True)
    given = parser.parse_args()
    texts = help_text.read_all(given.patina, given.patinad)
    top, patinad = help_text.Help(texts["patina"]), help_text.Help(texts["patinad"])
    commands = [(name.split()[1], help_text.Help(text)) for name, text in texts.items() if " " in name]
    version = help_text.ask(given.patinad, "--version").split()[-1]
    with open(given.schema, encoding="utf-8") as file:
        schema = json.load(file)
    os.makedirs(given.out, exist_ok=True)
    for name, text in (("patina.1", patina_page(top, commands, version)), ("patinad.8", patinad_page(patinad, version)),
                       ("patinad.json.5", config_page(schema, version)), ("patina.bash", completion(top, commands, patinad)),
                       ("help.json", json.dumps(texts, indent=1) + "\n")):
        with open(os.path.join(given.out, name), "w", encoding="utf-8") as file:
            file.write(text)


if __name__ == "__main__":
    main()
