"""Fixtures that tests of runs share."""

import pytest


@pytest.fixture
def own_locks(tmp_path, monkeypatch):
    """Claim cores among this test's processes alone: other tests run at the same time."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
