"""A store, and what works with it: thermocomp-fleet, thermocomp-uplink."""

import os
import pathlib
import re
import subprocess

BIN = pathlib.Path(os.environ["THERMOCOMP_BIN"])


class Store:
    """A database of its own in a running server."""

    def __init__(self, server, folder, name):
        self.server = server
        self.folder = folder
        self.name = re.sub(r"\W", "_", name.lower())[:40]
        server.ask(f"DROP DATABASE IF EXISTS {self.name}", conninfo=server.local("postgres"))
        for [role] in server.ask("SELECT rolname FROM pg_roles WHERE rolname LIKE 'machine\\_%'"
                                 " OR rolname LIKE 'person\\_%'", conninfo=server.local("postgres")):
            server.ask(f'DROP ROLE "{role}"', conninfo=server.local("postgres"))
        server.create_database(self.name)
        self.local = server.local(self.name)
        self.fleet("init")

    def fleet(self, *arguments, status=0):
        """Standard output of thermocomp-fleet; of a failure what it said on standard error."""
        done = subprocess.run([str(BIN / "thermocomp-fleet"), "--store", self.local, *map(str, arguments)],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True, cwd=self.folder)
        assert done.returncode == status, done.stdout + done.stderr
        return done.stdout if status == 0 else done.stderr

    def ask(self, sql):
        return self.server.ask(sql, conninfo=self.local)

    def value(self, sql):
        return self.server.value(sql, conninfo=self.local)

    def add(self, machine, *options, type="mill"):
        self.fleet("add", machine, "--type", type, "-o", self.folder / f"{machine}.password", *options)
        return self.password(machine)

    def password(self, machine):
        return (self.folder / f"{machine}.password").read_text().strip()

    def remote(self, user, *, tls="sslmode=verify-full", port=None):
        """A connection over the network."""
        return (f"host=localhost port={port or self.server.port} user={user} dbname={self.name} "
                f"{tls} sslrootcert={self.server.authority}")

    def as_machine(self, machine, sql):
        """(exit status, rows, what went wrong)"""
        return self.server.run_sql(sql, conninfo=self.remote(f"machine_{machine}"), password=self.password(machine))

    def add_person(self, name, *groups):
        """A role that logs in over the Unix socket."""
        self.ask(f"CREATE ROLE person_{name} LOGIN; GRANT {', '.join(groups)} TO person_{name}")

    def as_person(self, name, sql):
        return self.server.run_sql(sql, conninfo=self.local.replace("user=postgres", f"user=person_{name}"))
