"""Configuration of Sphinx for the site of README.md, docs and the docstrings: `make docs`."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import fishbone

if TYPE_CHECKING:
    from sphinx.application import Sphinx

TREE = """
```{toctree}
:hidden:
:caption: Use

docs/scenario
docs/sweep
docs/command
docs/python/index
docs/c
docs/gallery
```

```{toctree}
:hidden:
:caption: Understand

docs/notation
docs/theory
docs/strip-shell
docs/promises
docs/validation
docs/performance
```

```{toctree}
:hidden:
:caption: Studies

docs/shapes
docs/shear
```

```{toctree}
:hidden:
:caption: The project

CHANGELOG
CONTRIBUTING
```
"""

project = "fishbone"
project_copyright = "The fishbone authors"
version = release = fishbone.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx_click"]

# The source is the whole repository, so that links lead to the same files here and on the web page of the repository.
root_doc = "README"
include_patterns = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/*.md", "docs/**.rst"]
exclude_patterns = [".*", "benchmarks", "crates", "dist", "examples", "out", "python", "scenarios", "target", "tests"]
myst_heading_anchors = 4
highlight_language = "none"
smartquotes = False

autosummary_generate = False
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
default_role = "py:obj"
toc_object_entries_show_parents = "hide"

html_theme = "furo"
pygments_dark_style = "github-dark"
html_title = f"fishbone {release}"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False


LABEL = re.compile(r"(Shapes|Units|Source|Errors): ")
FIELD_OF_TUPLE = re.compile(r"Alias for field number \d+")


def add_tree(_app: Sphinx, name: str, source: list[str]) -> None:
    """Appends the tree of pages to the landing page, which has no tree in the repository."""
    if name == root_doc:
        source[0] += TREE


def mark_up(_app: Sphinx, _what: str, _name: str, _object: object, _options: object, lines: list[str]) -> None:
    """Makes fields of the lines of a docstring that begin with a `LABEL`; escapes bars."""
    is_field = False
    for index, line in enumerate(lines):
        marked = "" if FIELD_OF_TUPLE.fullmatch(line) else line.replace("|", r"\|")
        if LABEL.match(marked):
            is_field = True
            marked = f":{marked}"
        elif not marked:
            is_field = False
        elif is_field:
            marked = f"  {marked}"
        lines[index] = marked


def hide_core(
    _app: Sphinx, what: str, _name: str, _object: object, _options: object, signature: str | None, _returns: str | None
) -> tuple[str, None] | None:
    """Hides the constructors of objects that only the package makes."""
    return ("", None) if what == "class" and "_core." in (signature or "") else None


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", add_tree)
    app.connect("autodoc-process-docstring", mark_up)
    app.connect("autodoc-process-signature", hide_core)
