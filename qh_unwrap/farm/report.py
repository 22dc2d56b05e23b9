# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of a batch: a table in .csv, or a page in .html with a picture of each file's UVs."""

import csv
import html
import io
from pathlib import Path

from .. import __version__
from ..addon import writing
from ..addon.failures import FileError, UsageError
from .entry import OK

_COUNTED = ("objects", "islands", "certified", "failed", "flips", "collapsed", "faces")
COLUMNS = ("input", "output", "status", "error", *_COUNTED, "stretch", "energy", "write", "warnings")
COLUMNS += ("attempts", "seconds", "host")
_CSV = ",".join(COLUMNS)
_HTML = "<!DOCTYPE html><!-- a report of qh-unwrap -->"


def check(path, *, overwrite, resume):
    """Raise `UsageError` where a report cannot be written to the path."""
    if path.suffix.lower() not in _FORMATS:
        raise UsageError(f"cannot write the report {path}: it can be {' or '.join(_FORMATS)}")
    if not path.absolute().parent.is_dir():
        raise UsageError(f"there is no folder {path.absolute().parent}")
    if path.exists() and not path.is_file():
        raise UsageError(f"{path} is a folder, or no file to write to")
    if path.exists() and not overwrite and not (resume and _is_ours(path)):
        raise UsageError(f"{path} exists: choose another name, or pass --overwrite")
    writing.check_folder(path)


def _is_ours(path):
    with open(path, encoding="utf-8-sig", errors="replace") as stream:
        return stream.readline().strip() in (_CSV, _HTML)


def write(path, entries):
    """Write a report of the entries, in the order in which they are given."""
    try:
        with writing.Staging(overwrite=True) as staging:
            staging.write_text(path, _shown(_FORMATS[path.suffix.lower()](entries)))
            staging.put_in_place()
    except (OSError, FileError) as error:
        raise FileError(f"cannot write the report {path}: {error}") from error


def _shown(text):
    """The text without the halves of characters that stand for bytes in names which are no text."""
    return text.encode(errors="backslashreplace").decode()


def _row(entry):
    details, totals = entry.details, entry.totals
    warnings = [*(each["message"] for each in details.get("not_written", ())), *details.get("warnings", ())]
    return {
        **{name: totals.get(name, "") for name in _COUNTED},
        "input": entry.input,
        "output": entry.output,
        "status": entry.status,
        "error": entry.error or "",
        "stretch": _number(entry.stretch),
        "energy": _number(entry.energy),
        "write": details.get("write") or "",
        "warnings": "; ".join(warnings),
        "attempts": entry.attempts,
        "seconds": f"{entry.seconds:.3f}",
        "host": entry.host,
    }


def _number(value):
    return "" if value is None else f"{value:.6f}"


def _csv(entries):
    stream = io.StringIO()
    table = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
    table.writeheader()
    table.writerows(map(_row, entries))
    return stream.getvalue()


_SHOWN = ("status", "islands", "certified", "faces", "stretch", "energy", "attempts", "seconds", "host")
_STYLE = """
body { font: 14px sans-serif; margin: 2em; color: #222; background: #fff }
table { border-collapse: collapse }
th, td { border-bottom: 1px solid #ddd; padding: 4px 10px; text-align: left; vertical-align: top }
img { image-rendering: pixelated; display: block }
.bad { background: #fdeaea }
small { color: #666; overflow-wrap: anywhere }
"""


def _html(entries):
    head = "".join(f"<th>{name}</th>" for name in ("UVs", "file", *_SHOWN))
    rows = "\n".join(map(_html_row, entries))
    title = f"<title>QH Unwrap</title><style>{_STYLE}</style>"
    return (
        f"{_HTML}\n<html lang=\"en\"><head><meta charset=\"utf-8\">{title}</head><body>\n<h1>{summary(entries)}</h1>\n"
        f"<table><thead><tr>{head}</tr></thead><tbody>\n{rows}\n</tbody></table>\n"
        f"<p><small>QH Unwrap {__version__}</small></p></body></html>\n"
    )


def _html_row(entry):
    row = {name: html.escape(str(value)) for name, value in _row(entry).items()}
    source = f"data:image/png;base64,{entry.preview}"
    picture = f"<img src=\"{source}\" width=\"128\" height=\"128\" alt=\"\">" if entry.preview else ""
    notes = "".join(f"<br><small>{row[name]}</small>" for name in ("error", "warnings") if row[name])
    name = f"{html.escape(Path(entry.input).name)}<br><small>{row['output']}</small>{notes}"
    cells = "".join(f"<td>{text}</td>" for text in (picture, name, *(row[each] for each in _SHOWN)))
    return f"<tr>{cells}</tr>" if entry.is_good else f"<tr class=\"bad\">{cells}</tr>"


_FORMATS = {".csv": _csv, ".html": _html}


def summary(entries):
    """How many there are of each status: "10 files: 8 ok, 1 partial, 1 crashed"."""
    counts = {OK: 0} | dict.fromkeys(sorted(entry.status for entry in entries), 0)
    for entry in entries:
        counts[entry.status] += 1
    parts = ", ".join(f"{number} {status}" for status, number in counts.items() if number)
    return f"{len(entries)} file{'' if len(entries) == 1 else 's'}: {parts or 'nothing was done'}"
