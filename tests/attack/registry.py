"""All attacks by name. An attack is a function that makes one try with a Rig."""

import dataclasses
import typing

ALL = {}


@dataclasses.dataclass
class Attack:
    name: str
    run: typing.Callable
    links: tuple
    choices: dict
    limit_s: float
    text: str


def attack(links=("tcp",), limit_s=60.0, name=None, **choices):
    """`choices`: for the Rig's machine. `limit_s`: longer tries have failed."""
    def note(run):
        called = name or run.__name__.replace("_", " ")
        assert called not in ALL, called
        ALL[called] = Attack(called, run, links, choices, limit_s, (run.__doc__ or "").strip())
        return run
    return note
