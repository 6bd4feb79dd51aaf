"""The one error that is the user's to mend."""

from __future__ import annotations


class UserError(Exception):
    """Bad input: one clear line that says which file or option, what is wrong, and what to do.

    The command line prints the message alone and exits with code 2. Anything else that escapes is a bug of ours.
    """
