"""Sphinx's settings for the site of the documentation, `make docs`.

The pages are the Markdown files of the repository as they are; its README is the first one. Nothing
is loaded from elsewhere: equations are MathML, fonts are those of the reader's system.
"""

from pathlib import Path

ROOT = Path(__file__).parents[2]

NAVIGATION = {
    "Tutorials": [
        "docs/README",
        "docs/tutorials/1_first_run",
        "docs/tutorials/2_your_own_road_user_and_path",
        "docs/tutorials/3_sweep_a_parameter",
        "docs/tutorials/4_add_a_tracker",
        "docs/tutorials/5_results_in_python",
        "docs/tutorials/6_your_own_scans",
        "docs/tutorials/7_stixels_of_your_own_images",
    ],
    "How to": [
        "docs/real-data",
        "docs/tune",
        "docs/cluster",
        "docs/security",
    ],
    "Results": [
        "docs/paper",
        "docs/gallery",
        "docs/studies",
        "docs/accuracy",
        "docs/benchmark",
        "docs/benchmark-1.0",
    ],
    "Reference": [
        "docs/settings",
        "docs/site/api",
        "docs/result-folder",
        "docs/data-flow",
        "docs/theory",
        "docs/thesis",
        "docs/several_targets",
        "docs/decisions",
    ],
    "Project": ["CONTRIBUTING", "CHANGELOG"],
}
"""Caption to pages, in the order of the site's navigation; the tests hold it complete."""

project = "stixel"
author = copyright = "The stixel developers"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
root_doc = "README"
include_patterns = ["README.md", *(f"{page}.*" for pages in NAVIGATION.values() for page in pages)]
exclude_patterns = [".*", "build", "results", "tests", "bench", "stixel_cli", "**/*.py", "**/*.svg"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
default_role = "literal"
napoleon_use_ivar = True
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
# Results are mapped arrays, or types that a reader sees in the signature as they are written.
autodoc_preserve_defaults = True

html_theme = "furo"
html_title = "stixel"
html_math_renderer = "mathml"
html_copy_source = False
html_show_search_summary = False  # excerpts cannot be fetched from a file
html_show_sphinx = False
html_static_path = ["site.css"]
html_css_files = ["site.css"]


def _math(node, display: str) -> str:
    from latex2mathml.converter import convert

    return convert(node.astext(), display=display)


def _inline(translator, node):
    from docutils import nodes

    translator.body.append(_math(node, "inline"))
    raise nodes.SkipNode


def _block(translator, node):
    from docutils import nodes

    translator.body.append(f'<div class="math">{_math(node, "block")}</div>')
    raise nodes.SkipNode


def _add_navigation(app, name, content):
    """Add the navigation to the first page; where the README is read otherwise, it has none."""
    if name == root_doc:
        for caption, pages in NAVIGATION.items():
            lines = "\n".join(f"/{page}" for page in pages)
            content[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{lines}\n```\n"


def setup(app):
    """Register the renderer of equations and the navigation."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("source-read", _add_navigation)
