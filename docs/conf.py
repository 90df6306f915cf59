"""How Sphinx makes the site; scripts/build_site.py runs it and adds the pages that are made from the code."""

from importlib import metadata

project = "microrad"
author = "The microrad developers"
copyright = "The microrad developers, BSD-3-Clause"
version = release = metadata.version("microrad")

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "site_pages.extension"]
exclude_patterns = ["gallery/*", "_static/*"]

html_theme = "furo"
html_title = f"microrad {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
html_show_sourcelink = False
html_math_renderer = "mathml"  # at build time: the site needs no script for its formulas

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4

nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 600

default_role = "literal"  # docstrings write `code` as Markdown does
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
maximum_signature_line_length = 88
add_module_names = False
toc_object_entries = False
pygments_style = "a11y-high-contrast-light"
pygments_dark_style = "a11y-high-contrast-dark"
