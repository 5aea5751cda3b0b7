"""Where a store is: a file, or a database on a server, whose password is never shown.

A server's address is a URL: ``postgresql://user@host/database``, or ``mysql://`` or ``mariadb://`` alike. A port
comes after the host, settings of the connection after a question mark: ``?sslmode=verify-full``,
``?options=-csearch_path%3Drig1``.
"""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self
from urllib.parse import parse_qsl, unquote, urlsplit

from pneumarm.errors import UnusableInput

SYSTEMS = {"postgresql": "postgresql", "mysql": "mysql", "mariadb": "mysql"}
"""Systems of databases that a store can be kept in, by the scheme of its address."""
PASSWORD = "MYSQL_PWD"
"""The environment variable of MySQL's password; PostgreSQL's library reads PGPASSWORD and .pgpass by itself."""

_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://")
# No @, / or ? stands for itself in a password, so none can be taken for a host or a setting, which are shown.
_PARTS = re.compile(_SCHEME.pattern + r"(?:([^:@/?]*)(?::([^/?]*))?@)?([^@]*)")
_HIDDEN = "***"
_SHOWN_PASSWORDS = (
    (re.compile(r"(\w://[^\s:@/]*:)\S*@"), rf"\1{_HIDDEN}@"),
    (re.compile(r"([?&]\w*pass\w*=)[^&\s]*", re.IGNORECASE), rf"\1{_HIDDEN}"),
)
_EXPECTED = "expected postgresql://user@host/database or mysql://user@host/database"


def masked(text: str) -> str:
    """Return ``text`` without the passwords of addresses in it."""
    for pattern, shown in _SHOWN_PASSWORDS:
        text = pattern.sub(shown, text)
    return text


@dataclass(frozen=True, repr=False)
class ServerAddress:
    """A database on a server; wherever it is shown, the password is not."""

    scheme: str
    user: str | None
    password: str | None
    host: str | None
    port: int | None
    database: str
    settings: Mapping[str, str]
    """Of the connection, for the driver."""

    @classmethod
    def parsed(cls, url: str) -> Self:
        """Return the address that ``url`` is.

        Raises:
            UnusableInput: it is none that is known; the message does not show what may be a password.

        """
        scheme = url.partition("://")[0]
        if scheme not in SYSTEMS:
            raise UnusableInput(f"{scheme}://: {_EXPECTED}")
        found = _PARTS.fullmatch(url)
        try:
            rest = urlsplit(f"//{found[4]}") if found else None
            port = rest.port if rest else None
        except ValueError:
            found = rest = None
        if found is None or rest is None:
            raise UnusableInput(
                f"{scheme}://: {_EXPECTED}, this is something else; in a password write @ as %40, / as %2F, ? as %3F"
            )
        if not (database := unquote(rest.path.removeprefix("/"))):
            raise UnusableInput(f"{masked(url)}: names no database; {_EXPECTED}")
        user, password = (unquote(one) if one else None for one in found.group(2, 3))
        return cls(scheme, user, password, rest.hostname, port, database, dict(parse_qsl(rest.query)))

    @property
    def system(self) -> str:
        """The system of databases: postgresql or mysql."""
        return SYSTEMS[self.scheme]

    def the_password(self) -> str | None:
        """Return the password that was given, here or in the environment; PostgreSQL's library looks for others."""
        return self.password or (os.environ.get(PASSWORD) if self.system == "mysql" else None)

    def __str__(self) -> str:
        entrance = "" if self.user is None else f"{self.user}{f':{_HIDDEN}' if self.password else ''}@"
        port = "" if self.port is None else f":{self.port}"
        settings = "&".join(f"{name}={value}" for name, value in self.settings.items())
        asked = f"?{settings}" if settings else ""
        return masked(f"{self.scheme}://{entrance}{self.host or ''}{port}/{self.database}{asked}")

    __repr__ = __str__


Address = Path | ServerAddress
"""Where a store is."""
StoreAddress = Address | str
"""The same as a person may give it: a path, or a URL as text."""


def address_of(given: StoreAddress) -> Address:
    """Return where the store is that a person has ``given``.

    Raises:
        UnusableInput: it is the address of a server, and not a whole one.

    """
    if isinstance(given, ServerAddress):
        return given
    if isinstance(given, str) and _SCHEME.match(given):
        return ServerAddress.parsed(given)
    for scheme in SYSTEMS:
        if str(given).startswith(f"{scheme}:"):  # a Path makes one slash of two
            raise UnusableInput(f"{scheme}:/: {_EXPECTED}, as text with two slashes, not as a Path")
    return Path(given)
