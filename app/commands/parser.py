"""The argument parser of every command: one line for a mistake, and the nearest name."""

import argparse
import re
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, NoReturn

BAD_INPUT = 2


class Once(argparse.Action):
    """Store what is given, and refuse a second one, which would win in silence.

    It remembers being used, so a parser serves one command line.
    """

    used = False

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        """Take the value of one use."""
        if self.used:
            parser.error(f"{option_string} is given twice; give it once")
        self.used = True
        setattr(namespace, self.dest, values)


class Parser(argparse.ArgumentParser):
    """An argument parser that complains in one line and suggests the nearest name."""

    commands: "Mapping[str, Parser]" = {}

    def __init__(self, **settings: Any):
        super().__init__(allow_abbrev=False, **settings)
        self.register("action", None, Once)
        # No option begins with a digit, so whatever does after a minus is a value: -1:2 too.
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def refuse_unknown(self, arguments: Sequence[str]) -> None:
        """Refuse a misspelt command or option before anything else is found missing.

        Also what a shell makes of an unset variable.
        """
        for text in arguments:
            if text == "--":
                break
            name, equals, value = text.partition("=")
            if not text or (name.startswith("--") and equals and not value):
                self.error(f"{name or 'an argument'} is empty; give it a value or leave it out")
            if name.startswith("--") and name not in self._option_string_actions:
                known = [text for text in self._option_string_actions if text.startswith("--")]
                self.error(f"there is no option {name} ({_near(name, known)})")
            if not name.startswith("-") and self.commands:
                if name not in self.commands:
                    self.error(f"there is no command {name!r} ({_near(name, self.commands)})")
                self.commands[name].refuse_unknown(arguments[1:])
                break

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line and stop."""
        if message.endswith("required: RUN"):
            message += " (a list of names takes what follows it; put the recordings first)"
        self.exit(BAD_INPUT, f"{self.prog}: {message}; see {self.prog} --help\n")


def _near(name: str, known: Iterable[str]) -> str:
    near = get_close_matches(name, list(known), n=1)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
