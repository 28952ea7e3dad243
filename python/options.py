"""Writes the options of the jobs into the signatures and docstrings of the package, from the schemas of the structs that take them.

    python python/options.py          # in an environment that has the package: writes python/athermal/__init__.py
    python python/options.py --check  # fails where that would change it
"""

from __future__ import annotations

import json
import keyword
import re
import sys
from pathlib import Path
from typing import Any

FILE = Path(__file__).parent / "athermal" / "__init__.py"
MARK = re.compile(r"^( *)# Options of (\w+), written by `python/options.py`:\n", re.MULTILINE)
WIDTH = 140
# Paths are texts in a schema; and what has a better name here.
PATHS = {"keep_blocks", "schedule", "compensate"}
CALLED = {"fault": "faults"}


def words(text: str) -> str:
    """A text with options as they are called here."""
    text = re.sub(r"--([a-z]+(?:-[a-z]+)*) ([a-z]+-[a-z]+)", lambda of: f'{of[1].replace("-", "_")}="{of[2]}"', text)
    text = re.sub(r"(?<!`)--([a-z]+(?:-[a-z]+)*)", lambda of: f"`{of[1].replace('-', '_')}`", text)
    text = re.sub(r"--([a-z]+(?:-[a-z]+)*)", lambda of: of[1].replace("-", "_"), text)
    return " ".join(text.split())


def type_of(name: str, schema: dict[str, Any], defs: dict[str, Any]) -> tuple[str, str]:
    """The type of an option and what it is without being given."""
    if "anyOf" in schema:
        schema = next(of for of in schema["anyOf"] if of.get("type") != "null")
    default = schema.get("default")
    if "$ref" in schema:
        one = defs[schema["$ref"].rpartition("/")[2]]
        values = one.get("enum") or [of["const"] for of in one.get("oneOf", []) if "const" in of]
        return (f"Literal[{', '.join(map(json.dumps, values))}] | None" if values else "str | None"), "None"
    kind = schema["type"]
    kind = next(of for of in kind if of != "null") if isinstance(kind, list) else kind
    if kind == "array":
        return "str | Sequence[str] | None", "None"
    plain = {"boolean": "bool", "integer": "int", "number": "float"}.get(kind)
    if plain and default is not None:
        return plain, repr(default)
    return ("str | os.PathLike[str] | None" if name in PATHS else f"{plain or 'str'} | None"), "None"


def wrapped(text: str, indent: str) -> list[str]:
    lines, line = [], indent
    for word in text.split():
        if len(line) + len(word) > WIDTH and line.strip():
            lines.append(line.rstrip())
            line = indent + "    "
        line += word + " "
    return [*lines, line.rstrip()]


def written(text: str, jobs: dict[str, Any]) -> str:
    """The module with the options of the jobs in it."""
    made, at = "", 0
    for mark in MARK.finditer(text):
        indent, job = mark[1], mark[2]
        end = text.index(f"{indent[:-4]}) ->", mark.end())
        begin = text.rindex("def ", 0, mark.start())
        stated = set(re.findall(r"^ +(\w+):", text[begin : mark.start()], re.MULTILINE))
        schema = jobs[job]
        options = {name: of for name, of in schema["properties"].items() if name not in stated | {"data"}}
        signature, docs = "", []
        for name, of in options.items():
            called = CALLED.get(name, f"{name}_" if keyword.iskeyword(name) else name)
            kind, default = type_of(name, of, schema.get("$defs", {}))
            signature += f"{indent}{called}: {kind} = {default},\n"
            first = of.get("description", "").partition("\n\n")[0]
            docs += wrapped(f"{called}: {words(first).rstrip('.')}.", f"{indent}    ")
        close = text.index('"""', text.index('"""', end) + 3)
        doc = text[end:close]
        doc = doc.partition(f"\n\n{indent}Options:\n")[0].rstrip()
        made += text[at : mark.end()] + signature + doc + f"\n\n{indent}Options:\n" + "\n".join(docs) + f"\n{indent}"
        at = close
    return made + text[at:]


def main() -> int:
    # The package that is installed, not its sources beside this file.
    sys.path.pop(0)
    from athermal import _athermal

    text = FILE.read_text(encoding="utf-8")
    new = written(text, json.loads(_athermal.options()))
    if "--check" in sys.argv:
        return int(new != text)
    FILE.write_text(new, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
