"""Fixtures that several rooms share."""

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from regbench.compiled.cache import settle

REPOSITORY = Path(__file__).resolve().parent.parent


def pytest_configure() -> None:
    """Hear the signals that tests send, and keep compiled code as regbench does.

    A background shell lets its children ignore Ctrl-C and hang-ups.
    """
    for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) == signal.SIG_IGN:
            signal.signal(number, handler)
    settle()


@pytest.fixture(autouse=True)
def path_of_imports() -> Iterator[None]:
    """Leave no plugin's folder on sys.path: what lies in it would be an installed module to the tests after it."""
    before = [*sys.path]
    yield
    sys.path[:] = before


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real data: REGBENCH_SHARED_DATA, else ../shared/data beside the checkout."""
    folder = Path(os.environ.get("REGBENCH_SHARED_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        message = f"real data missing: {folder} (set REGBENCH_SHARED_DATA)"
        if os.environ.get("CI") == "true":
            pytest.fail(message)
        pytest.skip(message)
    return folder


@pytest.fixture(scope="session")
def prepared_data(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The real ModelNet40 and 7-Scenes, prepared once for the whole test session."""
    from regbench_data_prep import modelnet40, seven_scenes

    folder = tmp_path_factory.mktemp("prepared")
    modelnet40.prepare(shared_data / "modelnet40_ply_hdf5_1024", folder, report=lambda message: None)
    seven_scenes.prepare(shared_data / "7scenes", folder, report=lambda message: None)
    return folder
