"""``python -m pneumarm``: the command line without its script."""

from pneumarm.cli import main

if __name__ == "__main__":
    main()
