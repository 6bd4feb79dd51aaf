"""The one error that is the user's to mend."""

from __future__ import annotations


class UserError(Exception):
    """Bad input: one clear line that says which file or option, what is wrong, and what to do.

    The command line prints the message alone and exits with code 2. Anything else that escapes is a bug of ours.

    Args:
        message: May quote a damaged file: line ends become spaces, and what a terminal would obey is escaped.
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


def printable(text: str) -> str:
    """Return a text of unknown origin as one line that a terminal prints: line ends as spaces, controls escaped."""
    return "".join(map(_printable, text))


def _printable(character: str) -> str:
    if character.isprintable():
        return character
    return " " if character.isspace() else character.encode("unicode_escape").decode()
