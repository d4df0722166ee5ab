"""An unprivileged PostgreSQL for a test, in a folder removed with it."""

import contextlib
import os
import pathlib
import pwd
import shutil
import socket
import subprocess
import sys
import tempfile

PATIENCE_S = 60


def programs():
    """Folder of Debian's server programs, newest version."""
    found = sorted(pathlib.Path("/usr/lib/postgresql").glob("*/bin/initdb"),
                   key=lambda path: float(path.parts[-3]))
    assert found, "no PostgreSQL server: install the package postgresql"
    return found[-1].parent


def free_port():
    with contextlib.closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Postgres:
    """A server with its own port and Unix socket. Its administrator is the caller or, for root,
    which PostgreSQL refuses, the package's user postgres."""

    def __init__(self, place=None):
        self.bin = programs()
        # Short: a Unix socket's path is limited to 107 characters.
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="fleet", dir=place))
        self.data = self.folder / "data"
        self.port = free_port()
        self.user = "postgres" if os.geteuid() == 0 else pwd.getpwuid(os.geteuid()).pw_name
        if os.geteuid() == 0:
            shutil.chown(self.folder, "postgres")
        self.folder.chmod(0o755)
        self._as_server(self.bin / "initdb", "-D", self.data, "-U", "postgres", "--auth=trust", "--no-sync",
                        "--no-instructions", "-E", "UTF8", "--locale=C.UTF-8")
        self.allow("local all all trust", "host all all 127.0.0.1/32 scram-sha-256")
        # A killed server loses nothing without fsync; only a crash of the computer would.
        self.configure(fsync="off", listen_addresses="'127.0.0.1'", port=self.port, max_connections=200,
                       unix_socket_directories=f"'{self.folder}'")

    def _as_server(self, *command, check=True):
        command = [str(part) for part in command]
        if os.geteuid() == 0:
            command = ["setpriv", "--reuid=postgres", "--regid=postgres", "--init-groups", *command]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, cwd=self.folder)
        assert done.returncode == 0 or not check, done.stdout
        return done

    def configure(self, **settings):
        with (self.data / "postgresql.conf").open("a") as file:
            file.writelines(f"{name} = {value}\n" for name, value in settings.items())

    def allow(self, *lines):
        (self.data / "pg_hba.conf").write_text("\n".join(lines) + "\n")

    def require_tls(self):
        """A certificate for localhost from its own authority; unencrypted connections are refused."""
        def openssl(*arguments):
            subprocess.run(["openssl", *map(str, arguments)], check=True, cwd=self.folder,
                           stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.authority = self.folder / "authority.crt"
        openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", 3650,
                "-subj", "/CN=test authority", "-keyout", "authority.key", "-out", self.authority)
        openssl("req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
                "-subj", "/CN=localhost", "-keyout", "data/server.key", "-out", "server.csr")
        (self.folder / "names").write_text("subjectAltName=DNS:localhost\n")
        openssl("x509", "-req", "-in", "server.csr", "-CA", self.authority, "-CAkey", "authority.key",
                "-CAcreateserial", "-days", 3650, "-extfile", "names", "-out", "data/server.crt")
        for name in ("server.key", "server.crt"):
            if os.geteuid() == 0:
                shutil.chown(self.data / name, "postgres")
            (self.data / name).chmod(0o600)
        self.configure(ssl="on")
        self.allow("local all all trust", "hostssl all all 127.0.0.1/32 scram-sha-256")

    def start(self):
        self._as_server(self.bin / "pg_ctl", "-D", self.data, "-l", self.folder / "log", "-w", "-t", PATIENCE_S, "start")
        return self

    def stop(self, mode="fast"):
        """mode "immediate": like a power failure."""
        self._as_server(self.bin / "pg_ctl", "-D", self.data, "-m", mode, "-w", "stop", check=False)

    def end(self):
        self.stop("immediate")
        shutil.rmtree(self.folder, ignore_errors=True)

    def local(self, database="fleet"):
        """Connection of its administrator over the Unix socket."""
        return f"host={self.folder} port={self.port} user=postgres dbname={database}"

    def run_sql(self, sql, conninfo=None, password=None):
        """(exit status, rows as lists of texts, error). NULL is an empty text."""
        environment = dict(os.environ, PGPASSWORD=password) if password else None
        done = subprocess.run(["psql", "-X", "-q", "-A", "-t", "-F", "\t", "-v", "ON_ERROR_STOP=1",
                               conninfo or self.local()], input=sql, capture_output=True, text=True, env=environment)
        return done.returncode, [line.split("\t") for line in done.stdout.splitlines()], done.stderr

    def ask(self, sql, **rest):
        """Rows of a statement that must succeed."""
        status, rows, problem = self.run_sql(sql, **rest)
        assert status == 0, problem
        return rows

    def value(self, sql, **rest):
        return self.ask(sql, **rest)[0][0]

    def create_database(self, name="fleet"):
        self.ask(f"CREATE DATABASE {name}", conninfo=self.local("postgres"))


def until_stopped():
    """For scripts: prints the connection of a new database `fleet`, and ends with its standard input."""
    server = Postgres().start()
    try:
        server.create_database()
        print(server.local(), flush=True)
        sys.stdin.read()
    finally:
        server.end()


if __name__ == "__main__":
    until_stopped()
