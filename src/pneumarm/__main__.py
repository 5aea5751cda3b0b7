"""``python -m pneumarm`` is ``pneumarm``."""

from pneumarm.cli import main

if __name__ == "__main__":
    main()
