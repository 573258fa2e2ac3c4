"""Settings of the documentation site, which `make docs` builds from the pages for users.

The source folder is the root of the repository, so that the pages and the links between them are
those that one reads there. Nothing is loaded from the network, neither here nor by the pages.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

SITE = Path(__file__).parent
ROOT = SITE.parents[1]
sys.path[:0] = [str(SITE), str(ROOT)]
# notebooks run the commands of this environment, one thread each, without colours and moving bars
os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
os.environ["PYTHONPATH"] = str(ROOT)
os.environ |= {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "NO_COLOR": "1",
    "TTY_INTERACTIVE": "0",
}
# ... with settings of their own, not those of whoever builds
os.environ.pop("MPLBACKEND", None)
_PROFILE = ROOT / "build/ipython/profile_default"
_PROFILE.mkdir(parents=True, exist_ok=True)
(_PROFILE / "ipython_kernel_config.py").write_text("c.Application.log_level = 'ERROR'\n")
os.environ["IPYTHONDIR"] = str(_PROFILE.parent)

import soilml  # noqa: E402

project = "soilml"
version = release = soilml.__version__
author = "the authors of soilml"
language = "en"
root_doc = "docs/index"
html_title = f"soilml {release}"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "command_listing",
    "command_output",
    "error_listing",
    "foreign_addresses",
    "mathml",
    "page_tree",
    "python_reference",
    "repository_files",
]
include_patterns = ["CHANGELOG.md", "docs/**.md", "exported/*.md", "examples/*/README.md"]
exclude_patterns = [".*", "build", "demo", "dist", "docs/decisions", "docs/site", "tests"]

# words in the types of parameters, such as `rows`, are looked up as names, and some are attributes
suppress_warnings = ["ref.python"]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "attrs_inline"]
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True
nb_mime_priority_overrides = [("html", "image/png", 0)]

default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
napoleon_google_docstring = False
napoleon_use_rtype = False
add_module_names = False

html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["soilml.css"]
html_extra_path = ["root"]
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False
html_math_renderer = "mathml"
pygments_style = "tango"
pygments_dark_style = "github-dark"
copybutton_exclude = ".linenos, .gp, .go"


def setup(app: Sphinx) -> None:
    """CSV blocks are shown as text, without highlighting."""
    app.add_lexer("csv", TextLexer)
