"""Tables in Markdown, and their insertion into a document."""

import os
import re
from pathlib import Path

# The vector instructions that both are limited to; all without a name.
LIMIT = os.environ.get("PLAYBOT_INSTRUCTIONS", "")


def number(x):
    """Formats three digits."""
    return f"{x:.2f}" if x < 10 else f"{x:.1f}" if x < 100 else f"{x:,.0f}"


def table(header, rows):
    """Returns the lines of a table whose first column is words."""
    line = lambda cells: "| " + " | ".join(cells) + " |"
    rule = "|---|" + "---:|" * (len(header) - 1)
    return "\n".join([line(header), rule, *map(line, rows)])


def limit():
    """Returns the limit in words, for the name of the machine."""
    return f", both limited to {LIMIT.upper()}" if LIMIT else ""


def suffix():
    """Returns what the name of a table with this limit ends with."""
    return f"-{LIMIT}" if LIMIT else ""


def put(document, name, text):
    """Replaces the text between `<!-- name -->` and `<!-- /name -->` in the document."""
    path, begin, end = Path(document), f"<!-- {name} -->", f"<!-- /{name} -->"
    old = path.read_text()
    if begin not in old or end not in old:
        raise SystemExit(f"{path} has no place for this table: it needs the lines `{begin}` and `{end}`")
    new = re.sub(f"{re.escape(begin)}.*?{re.escape(end)}", lambda _: f"{begin}\n{text}\n{end}", old, flags=re.S)
    path.write_text(new)
