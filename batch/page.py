"""The page of a run: one HTML file that needs no network, with the results that want a look first.

Pictures are those of the contact sheets, each in the page once; a result shows its part of the sheet over the part
with the photo. Sheets are many megabytes for thousands of photos, so only those of the worst photos are in the page.
"""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterable, Mapping, Sequence

from ..core.errors import FileError
from . import storage
from .sheet import GAP, LABEL
from .work import ACROSS, Entry

# Photos whose pictures are in the page.
MOST_PICTURES = 200

_ORDER = {"failed": 0, "needs a person": 1, "done": 2}


def worst_first(entries: Mapping[str, Entry], names: Iterable[str]) -> list[str]:
    """Names of results in the order in which a person should look at them: failed, set aside, by predicted error."""

    def key(name: str) -> tuple[int, float, int, str]:
        entry = entries[name]
        error = entry.get("predicted_error", {}).get("bound90", 0.0)
        return _ORDER.get(entry["status"], len(_ORDER)), -error, -len(entry.get("warnings", ())), name

    ordered = sorted(map(key, names))
    return [name for order, *_, name in ordered if order < len(_ORDER)]


def run_page(entries: Mapping[str, Entry], names: Sequence[str], out: str, most: int = MOST_PICTURES) -> str:
    """Write the page.

    Parameters
    ----------
    entries
        Of results and contact sheets, by output; looked up one at a time.
    names
        Those that the page is about.
    out
        Output folder or URL, where the sheets are.
    most
        Photos whose pictures are in the page.

    Returns
    -------
    HTML.
    """
    cells: dict[str, tuple[str, list[int], int]] = {}
    for entry in map(entries.__getitem__, names):
        if entry["status"] == "sheet":
            cells |= {output: (entry["file"], entry["cell"], k) for k, output in enumerate(entry["cells"], 1)}
    counts = dict.fromkeys(_ORDER, 0)
    pictures: dict[str, str] = {}
    rows = []
    for name in worst_first(entries, names):
        entry, slider = entries[name], ""
        counts[entry["status"]] += 1
        if name in cells:
            sheet, cell, index = cells[name]
            if sheet not in pictures and len(pictures) < most and (data := _data(storage.join(out, sheet))):
                pictures[sheet] = data
            slider = _slider(sheet, cell, index) if sheet in pictures else ""
        rows.append(_row(entry, slider))
    headline = f"{counts['done']} done, {counts['needs a person']} need a person, {counts['failed']} failed"
    return _PAGE.format(headline=headline, rows="\n".join(rows), pictures=json.dumps(pictures).replace("<", "\\u003c"))


def _data(path: str) -> str:
    try:
        with storage.local(path) as place:
            return "data:image/jpeg;base64," + base64.b64encode(place.read_bytes()).decode()
    except (OSError, FileError):
        return ""  # the sheet was removed; the result is listed without it


def _row(entry: Entry, slider: str) -> str:
    error = entry.get("predicted_error", {})
    figures = []
    if error:
        figures.append(
            f"predicted CIEDE2000 {error['median']:.2f}, 90 % of the pixels below {error['bound90']:.2f}",
        )
    for check in entry.get("verification", ()):
        delivered = f"delivered {check['ciede2000']:.2f} from {check['target'] or 'the unchanged color'}"
        nearest = f" (the file can hold none nearer than {check['limit_ciede2000']:.2f})"
        figures.append(delivered + (nearest if check["limit_ciede2000"] > 0 else ""))
    said = [entry.get("reason", ""), *entry.get("warnings", ()), *entry.get("notes", ())]
    notes = "".join(f"<li>{html.escape(text)}</li>" for text in dict.fromkeys(said) if text)
    title = html.escape(f"{storage.name_of(entry['photo'])}, {entry['colorway']}")
    link = f'<a href="{html.escape(_quoted(entry["file"]))}">{title}</a>' if entry.get("file") else title
    return (
        f'<article data-status="{entry["status"]}" data-error="{error.get("bound90", "")}">{slider}'
        f'<div><h2>{link}</h2><p><b class="{entry["status"].split()[0]}">{entry["status"]}</b> '
        f"{html.escape(', '.join(entry.get('model', ())))} {html.escape('; '.join(figures))}</p><ul>{notes}</ul></div>"
        "</article>"
    )


def _slider(sheet: str, cell: Sequence[int], index: int) -> str:
    width, height = cell

    def part(number: int, kind: str) -> str:
        row, column = divmod(number, ACROSS)
        left, top = GAP + column * (width + GAP), GAP + row * (height + LABEL + GAP)
        return f'<i class="{kind}" style="background-position:-{left}px -{top}px"></i>'

    return (
        f'<figure data-sheet="{html.escape(sheet)}" style="width:{width}px;height:{height}px">'
        f"{part(index, 'after')}{part(0, 'before')}"
        '<input type="range" min="0" max="100" value="50" aria-label="before and after"></figure>'
    )


def _quoted(path: str) -> str:
    from urllib.parse import quote

    return quote(path)


_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>Dyehouse: {headline}</title>
<style>
body {{ font: 15px/1.4 system-ui, sans-serif; margin: 2em auto; max-width: 70em; padding: 0 1em; color: #222 }}
article {{ display: flex; gap: 1em; padding: 1em 0; border-top: 1px solid #ddd }}
h1, h2 {{ font-size: 1.1em; margin: 0 0 .3em }}
figure {{ position: relative; margin: 0; flex: none }}
figure i {{ position: absolute; inset: 0 }}
figure .before {{ clip-path: inset(0 50% 0 0) }}
figure input {{ position: absolute; inset: 0; width: 100%; height: 100%; margin: 0; opacity: .25; cursor: ew-resize }}
.failed {{ color: #b00020 }} .needs {{ color: #a05a00 }} .done {{ color: #2a6a2a }}
[hidden] {{ display: none }}
</style>
</head>
<body>
<h1>{headline}</h1>
<p><label>Show <select id="which"><option value="">all</option><option>needs a person</option><option>failed</option>
<option>done</option></select></label> <label>named <input id="named" type="search"></label></p>
{rows}
<script>
const pictures = {pictures};
const style = document.createElement("style");
const names = Object.keys(pictures);
style.textContent = names.map((n, k) => `.s${{k}} i {{ background-image: url("${{pictures[n]}}") }}`).join("\\n");
document.head.append(style);
for (const figure of document.querySelectorAll("figure")) {{
  figure.classList.add("s" + names.indexOf(figure.dataset.sheet));
  const before = figure.querySelector(".before"), range = figure.querySelector("input");
  range.addEventListener("input", () => {{ before.style.clipPath = `inset(0 ${{100 - range.value}}% 0 0)`; }});
}}
const which = document.getElementById("which"), named = document.getElementById("named");
function filter() {{
  for (const a of document.querySelectorAll("article")) {{
    const title = a.querySelector("h2").textContent.toLowerCase();
    a.hidden = (which.value && a.dataset.status !== which.value) || !title.includes(named.value.toLowerCase());
  }}
}}
which.addEventListener("input", filter);
named.addEventListener("input", filter);
</script>
</body>
</html>
"""
