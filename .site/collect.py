"""What MkDocs builds the site of: the rooms' pages where they stand, examples, a gallery, the public names.

A page of the repository has its own path on the site, so that links between pages lead on as they are. What else a page
links to is put beside it. Equations become MathML here, which browsers show without a script.
"""

from __future__ import annotations

import html
import inspect
import json
import posixpath
import re
from pathlib import Path
from types import ModuleType
from typing import Any

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import finger_pin as fp

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "scripts" / "examples"
#: Path on the site of every page of the repository.
PAGES = {str(path.relative_to(ROOT)): path for path in [ROOT / "README.md", *sorted(ROOT.glob("[fst]*/**/*.md"))]}
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#:\s]+)((?:#[\w-]+)?)\)")
# Static hosts leave out folders that begin with a dot.
PICTURES = (".readme/", "pictures/")
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add every page, and what pages link to."""

    def add(uri: str, content: str | None = None, path: Path | None = None) -> None:
        if files.get_file_from_path(uri) is None:
            files.append(File.generated(config, uri, content=content, abs_src_path=path and str(path)))

    pictures: dict[str, tuple[str, str]] = {}
    pages = {uri: path.read_text("utf-8") for uri, path in PAGES.items()}
    pages["contributing.md"] = (ROOT / ".github" / "CONTRIBUTING.md").read_text("utf-8").replace("](../", "](")
    for uri, text in pages.items():
        for shows, label, target, _ in LINK.findall(text):
            found = posixpath.normpath(posixpath.join(posixpath.dirname(uri), target))
            if shows:
                pictures.setdefault(found.replace(*PICTURES), (label, uri))
            path = ROOT / found
            if path.parent == EXAMPLES and path.suffix in (".py", ".ipynb"):
                add(f"scripts/examples/{path.stem}.md", example(path))
            elif path.is_file() and found not in PAGES:
                add(found.replace(*PICTURES), path=path)
        add(uri, text)
    add("gallery.md", gallery(pictures))
    for name, text in reference().items():
        add(f"api/{name}.md", text)
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Lead links to pictures and to sources of examples to where they are on the site."""

    def led(match: re.Match[str]) -> str:
        shows, label, target, anchor = match.groups()
        target = target.replace(*PICTURES)
        if posixpath.normpath(posixpath.join(posixpath.dirname(page.file.src_uri), target)).startswith(
            "scripts/examples/"
        ):
            target = re.sub(r"\.(py|ipynb)$", ".md", target)
        return f"{shows}[{label}]({target}{anchor})"

    return LINK.sub(led, markdown)


def on_page_content(content: str, **_: Any) -> str:
    """Turn equations into MathML."""

    def shown(match: re.Match[str]) -> str:
        return convert(html.unescape(match[3]), display="inline" if match[2] == "(" else "block")

    return FORMULA.sub(shown, content)


def example(path: Path) -> str:
    """Return the page of an example: its picture and its source."""
    picture = f"![{path.stem}](../../.readme/examples/{path.stem}.png)"
    if path.suffix == ".py":
        return f"# {path.name}\n\n{picture}\n\n```python\n{path.read_text('utf-8')}```\n"
    cells = json.loads(path.read_text("utf-8"))["cells"]
    texts = [(cell["cell_type"], "".join(cell["source"])) for cell in cells]
    return "\n\n".join([text if kind == "markdown" else f"```python\n{text}\n```" for kind, text in texts] + [picture])


def gallery(pictures: dict[str, tuple[str, str]]) -> str:
    """Return the page of all pictures, each with a link to the page that shows it."""
    shown = [f"[![{label}]({path})]({uri})\n{label}\n{{ .shown }}" for path, (label, uri) in pictures.items()]
    return "\n\n".join(["# Gallery", "Pictures of all pages; each leads to the page that it is from.", *shown])


def reference() -> dict[str, str]:
    """Return the pages of the public names, of `finger_pin` itself and of its public rooms."""
    rooms = {name: each for name in fp.__all__ if isinstance(each := getattr(fp, name), ModuleType)}
    pages = {"README": ("Names of fp", {name: getattr(fp, name) for name in fp.__all__ if name not in rooms})}
    for name, room in rooms.items():
        names = getattr(room, "__all__", None) or [each for each in vars(room) if not each.startswith("_")]
        pages[name] = (f"fp.{name}", {each: getattr(room, each) for each in names})
    seen: set[str] = set()
    return {name: "\n\n".join([f"# {title}", *documented(names, seen)]) for name, (title, names) in pages.items()}


def documented(names: dict[str, Any], seen: set[str]) -> list[str]:
    """Return a directive for every class and function of the package, or a link where another page has it."""
    directives, links = [], []
    for name, each in names.items():
        if (inspect.isclass(each) or inspect.isfunction(each)) and each.__module__.startswith("finger_pin"):
            path = f"{each.__module__}.{each.__qualname__}"
            if path in seen:
                links.append(f"[`{name}`][{path}]")
            else:
                directives.append(f"::: {path}")
            seen.add(path)
    return [f"See also {', '.join(links)}.", *directives] if links else directives
