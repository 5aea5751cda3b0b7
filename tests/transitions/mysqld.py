"""Where the server of MySQL or MariaDB is that stores are tested on; what a bare Python can say."""

import os
import shutil

PACKAGES = "mariadb-server-core mariadb-client-core"
"""Debian packages that bring one, and start nothing by themselves."""
NAMED = "PNEUMARM_MYSQLD"
"""The environment variable that names a program mysqld or mariadbd; else it is looked for on the path."""


def program() -> str | None:
    """Return the path of the server's program; None where there is none."""
    places = f"{os.environ.get('PATH', os.defpath)}{os.pathsep}/usr/sbin"  # which is not on every user's path
    return os.environ.get(NAMED) or shutil.which("mariadbd", path=places) or shutil.which("mysqld", path=places)


def missing() -> str:
    """Return what is missing for tests on such a server; empty where nothing is."""
    return "" if program() else f"mariadbd or mysqld missing ({NAMED} may name one); Debian packages: {PACKAGES}"
