"""The frame of a report in HTML: figures are inside the page, nothing is loaded from anywhere."""

from __future__ import annotations

import base64
import io
from html import escape

from matplotlib.figure import Figure

_STYLE = """
* { box-sizing: border-box; }
body { margin: 0; color: #1d2433; background: #f6f7f9; font: 15px/1.5 system-ui, sans-serif; }
main { max-width: 68rem; margin: 0 auto; padding: 2rem 1.25rem 4rem; }
h1 { font-size: 1.6rem; margin: 0; } h2 { font-size: 1.15rem; margin: 0 0 .4rem; } p { margin: .3rem 0; }
section { background: #fff; border: 1px solid #e3e6ec; border-radius: .5rem; padding: 1.2rem; margin-top: 1.2rem; }
table { border-collapse: collapse; width: 100%; margin-top: .6rem; font-size: .9rem; }
th { text-align: left; color: #5d6678; font-weight: 500; border-bottom: 2px solid #e3e6ec; }
th, td { padding: .3rem .8rem .3rem 0; vertical-align: top; } td { border-bottom: 1px solid #e3e6ec; }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.soft { color: #5d6678; } .doubt { color: #a15c00; }
img { display: block; max-width: 100%; height: auto; margin-top: .6rem; }
@media (max-width: 45rem) { section { overflow-x: auto; } img { max-width: none; } table { font-size: .8rem; }
  td:first-child { min-width: 7.5rem; overflow-wrap: anywhere; } }
"""


def document(title: str, body: str, style: str = "") -> str:
    """Return a page with a title, a body in HTML, and further rules of style."""
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_STYLE}{style}</style></head>"
        f"<body><main><h1>{escape(title)}</h1>{body}</main></body></html>\n"
    )


def image(figure: Figure, text: str) -> str:
    """Return a figure as an element of a page, with an alternative text."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", pil_kwargs={"compress_level": 2})
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f'<img alt="{escape(text)}" src="data:image/png;base64,{data}" width="{100 * figure.get_figwidth():.0f}">'
