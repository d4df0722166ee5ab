"""Starts a program with a blocked journal: in its own mount namespace the journal's socket exists,
and nobody reads it.

    unshare --mount --map-root-user unread_journal.py PROGRAM ARGUMENT...
"""

import os
import socket
import subprocess
import sys

subprocess.run(["mount", "-t", "tmpfs", "tmpfs", "/run"], check=True)
os.makedirs("/run/systemd/journal")
journal = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
journal.bind("/run/systemd/journal/socket")
os.set_inheritable(journal.fileno(), True)  # kept open by the program
os.environ["JOURNAL_STREAM"] = "8:1"
os.execv(sys.argv[1], sys.argv[1:])
