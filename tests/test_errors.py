"""What a damaged file says stays within its one line."""

import h5py
import pytest

from regbench.datasets.readers.h5 import read_h5_array
from regbench.errors import UserError


def test_what_a_terminal_would_obey_is_shown_and_not_obeyed():
    assert str(UserError("a\nb\r\x1b[2Jc\u2028d\udc80é 点")) == r"a b \x1b[2Jc d\udc80é 点"


def test_a_name_in_a_file_neither_breaks_the_line_nor_reaches_the_terminal(tmp_path):
    with h5py.File(tmp_path / "names.h5", "w") as file:
        file["two\nlines\x1b[2J"] = [1.0]
    with pytest.raises(UserError, match=r"has no array 'data' \(it has two lines\\x1b\[2J\)$"):
        read_h5_array(tmp_path / "names.h5", "data")
