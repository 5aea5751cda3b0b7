"""Print the errata as Markdown."""

import sys

from pneumarm.experiments.errata import page

sys.stdout.write(page())
