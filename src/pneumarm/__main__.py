"""``python -m pneumarm``: the command line without its script."""

from pneumarm.cli import main

main()
