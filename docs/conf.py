"""How the site is made of the documents (Sphinx reads this file; `python -m docs.site` calls it)."""

project = "trilobe"
html_title = "trilobe"
author = "the authors of trilobe"
root_doc = "index"
extensions = ["myst_parser"]
myst_heading_anchors = 4  # links to headings, by the names that they have elsewhere, too
html_theme = "furo"
html_static_path = ["site_look"]
html_css_files = ["print.css"]
html_show_sphinx = False
html_show_copyright = False
html_copy_source = False
html_show_sourcelink = False
highlight_language = "none"  # fenced blocks are commands and programs of a PMAC, which no lexer knows
html_theme_options: dict[str, object] = {"top_of_page_buttons": []}
