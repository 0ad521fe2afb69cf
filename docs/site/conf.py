"""Sphinx's settings for the site; docs/site/build.py runs it over a copy of the pages."""

import primray

project = "primray"
author = "the primray authors"
version = release = primray.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc"]
root_doc = "docs/site/index"
html_theme = "furo"
html_title = "primray"
html_show_sourcelink = False
html_show_copyright = False
html_copy_source = False
html_static_path = ["../../build/site/source/docs/site/static"]
html_favicon = "../../build/site/source/docs/site/static/favicon.svg"
html_css_files = ["site.css"]
html_js_files = ["address.js"]
html_theme_options = {"top_of_page_buttons": []}
myst_heading_anchors = 4
myst_enable_extensions = ["attrs_inline", "colon_fence"]
# Fences of languages that Pygments does not know stay plain text.
suppress_warnings = ["misc.highlighting_failure", "myst.header", "toc.not_included"]
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 120
autodoc_member_order = "bysource"
autodoc_typehints = "none"
