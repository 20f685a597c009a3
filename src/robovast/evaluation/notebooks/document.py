"""Renders a notebook as a self-contained HTML document without scripts."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nbformat import NotebookNode

_HEAD = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Notebook</title>
<style>
:root {
  --ground: #fff; --raised: #f5f7f9; --line: #d5dbe1; --text: #14202b; --bad: #b84a00;
  --name: #0b5a94; --word: #8b3a78; --value: #00745a; --remark: #4e5d6b;
  font: 15px/1.45 system-ui, "Segoe UI", "DejaVu Sans", sans-serif;
}
@media (prefers-color-scheme: dark) {
  :root {
    color-scheme: dark;
    --ground: #12181e; --raised: #1b232b; --line: #35414d; --text: #e6ebf0; --bad: #f59042;
    --name: #7cc0f2; --word: #dd92c8; --value: #3cc79f; --remark: #a3b0bc;
  }
}
body { margin: 1rem; background: var(--ground); color: var(--text); }
pre { margin: 0.4rem 0; overflow-x: auto; white-space: pre-wrap; }
.input_area { padding: 0.2rem 0.6rem; background: var(--raised); border: 1px solid var(--line); }
.output_error { padding: 0 0.6rem; border-left: 4px solid var(--bad); }
.prompt, .anchor-link { display: none; }
body:has(#code:not(:checked)) .cell:not(:has(.output_error)) > .input { display: none; }
.output_subarea { overflow-x: auto; }
.output_png img, .output_jpeg img, .output_svg svg {
  max-width: 100%; height: auto; background: #fff;
}
table { border-collapse: collapse; font-size: 0.9rem; }
th, td { padding: 0.2rem 0.6rem; border-bottom: 1px solid var(--line); text-align: right; }
.highlight .k, .highlight .kn, .highlight .ow { color: var(--word); }
.highlight .s1, .highlight .s2, .highlight .mi, .highlight .mf { color: var(--value); }
.highlight .nn, .highlight .nf, .highlight .nb { color: var(--name); }
.highlight .c1, .highlight .cm { color: var(--remark); }
.ansi-red-fg, .ansi-red-intense-fg { color: var(--bad); }
.ansi-green-fg, .ansi-green-intense-fg { color: var(--value); }
.ansi-cyan-fg, .ansi-blue-fg, .ansi-blue-intense-fg { color: var(--name); }
.ansi-bold { font-weight: bold; }
</style>
<label><input type="checkbox" id="code"> Show code</label>
"""


def html_of(notebook: NotebookNode) -> str:
    """The document; its content is untrusted, so show it in a sandbox."""
    from nbconvert import HTMLExporter

    body, _ = HTMLExporter(template_name="basic").from_notebook_node(notebook)
    return f"{_HEAD}<main>\n{body}\n</main>\n</html>\n"
