"""The site: ``make docs`` writes build/site from docs/ and the pages beside it.

Its source folder is that of the repository, so that links between pages, pictures and scenes mean
here what they mean where the files are read as they are. Nobody who reads it needs a network.
"""

from __future__ import annotations

import logging
import os
import sys
from importlib.util import find_spec
from pathlib import Path

_DOCS = Path(__file__).parent
sys.path[:0] = [str(_DOCS / x) for x in ('site', 'books', '..')]  # extensions; benchmarks, tests
# A pattern of pages that nobody has written yet is no mistake.
logging.getLogger('sphinx.sphinx.directives.other').addFilter(
    lambda record: 'glob pattern' not in record.getMessage()
)

project = 'mechanism_sim'
author = 'The mechanism_sim developers'
copyright = author  # noqa: A001
extensions = [
    'myst_nb',
    'sphinx.ext.autodoc',
    'sphinx.ext.napoleon',
    'sphinx_copybutton',
    'sphinx_design',
    'commands',
    'docstrings',
    'keys',
    'mathml',
    'measurements',
    'mechanisms',
    'messages',
    'motion',
    'quantities',
    'tools',
    'worn',
]
root_doc = 'docs/index'
include_patterns = [
    'README.md',
    'CHANGELOG.md',
    'CONTRIBUTING.md',
    'zenoh_rclpy/README.md',
    'docs/**',
]
exclude_patterns = ['.*', 'build', 'runs', 'docs/pictures', 'docs/site']
highlight_language = 'text'

myst_enable_extensions = ['attrs_inline', 'colon_fence', 'dollarmath', 'html_image']
myst_heading_anchors = 6
nb_execution_mode = 'cache'
nb_execution_cache_path = 'build/lessons'
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_execution_timeout = 120
nb_ipywidgets_js: dict[str, dict[str, str]] = {}

autodoc_typehints = 'description'
autodoc_typehints_format = 'short'
autodoc_member_order = 'bysource'
napoleon_google_docstring = False
napoleon_use_ivar = True

html_favicon = 'site/static/favicon.svg'
myst_html_meta = {
    'description lang=en': 'Simulator of real (loose, rattling, vibrating) planar machines',
    'property=og:title': 'mechanism_sim',
    # Who links to a page asks for an absolute address, known where the site is published.
    'property=og:image': f'{os.environ.get("SITE_ADDRESS", "")}_static/social.png',
}
html_theme = 'furo'
html_title = 'mechanism_sim'
html_math_renderer = 'mathml'
MATHS = find_spec('ziamath').submodule_search_locations[0]  # STIX Two Math, under the OFL
html_static_path = ['site/static', f'{MATHS}/fonts']
html_css_files = ['site.css']
html_js_files = ['site.js']
html_extra_path = ['site/front']
html_copy_source = False
html_theme_options = {
    'light_css_variables': {'color-brand-primary': '#1f4e79', 'color-brand-content': '#1f5f99'},
    'dark_css_variables': {'color-brand-primary': '#9cc4ea', 'color-brand-content': '#8ab8e6'},
}
copybutton_prompt_text = r'\$ |>>> |\.\.\. '
copybutton_prompt_is_regexp = True
