"""Every command in README and docs works as printed; only long ones are shortened: runs and trainings."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from regbench.cli.main import main
from regbench.runner import lane

REPOSITORY = Path(__file__).resolve().parents[2]
PAGES = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
# What a page's commands find in the current folder: see `workplace`.
FAILS_ON_PURPOSE = {"regbench check centroids --plugin my_method.py": 1}
# Its commands name every method on every protocol, several times: minutes of starting processes. Methods run on the
# other pages and in tests/baselines; here all is real but their answers.
RESULTS = REPOSITORY / "docs" / "results" / "README.md"
SET_UP = ("git clone", "cd ", "make ")


def blocks(page, language):
    return [text for kind, text in BLOCK.findall(page.read_text()) if kind == language]


def commands():
    for page in PAGES:
        lines = [line for text in blocks(page, "sh") for line in text.replace("\\\n", " ").splitlines() if line.strip()]
        for number, line in enumerate(lines):
            yield pytest.param(page, line, id=f"{page.name}-{number}")


@pytest.fixture(scope="session")
def workplace(tmp_path_factory, shared_data, prepared_data):
    """A folder with what the pages speak of: raw and prepared data, two clouds, pairs, and the pages' own files."""
    folder = tmp_path_factory.mktemp("docs")
    (folder / "raw").mkdir()
    (folder / "docs" / "results").mkdir(parents=True)
    (folder / "raw" / "modelnet40").symlink_to(shared_data / "modelnet40_ply_hdf5_1024")
    (folder / "raw" / "7scenes").symlink_to(shared_data / "7scenes")
    (folder / "data").symlink_to(prepared_data)
    bunny = shared_data / "extras" / "bunny"
    (folder / "a.ply").symlink_to(bunny / "bun000.ply")
    (folder / "b.ply").symlink_to(bunny / "bun045.ply")
    (folder / "my_pairs").mkdir()
    for name, scan in (("a", "bun000"), ("b", "bun045"), ("c", "bun090"), ("d", "bun315")):
        (folder / "my_pairs" / f"{name}.ply").symlink_to(bunny / f"{scan}.ply")
    (folder / "my_pairs" / "truth.txt").write_text("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")
    (folder / "my_pairs" / "pairs.csv").write_text(
        "source,target,T_target_source\na.ply,b.ply,truth.txt\nc.ply,d.ply,\n"
    )
    for page in PAGES:
        for text in blocks(page, "python") + blocks(page, "toml"):
            if named := re.match(r"# (\w+\.(?:py|toml))\n", text):
                (folder / named[1]).write_text(text)
    return folder


class AnswersIdentity:
    """A lane's worker without a process."""

    alive, failed = True, None

    def __init__(self, **options):
        pass

    def prepare(self):
        pass

    def trial(self, request, ahead, timeout_s):
        return {"status": "ok", "T_target_source": np.eye(4).tolist(), "time_ms": 1.0, "cpu_ms": 1.0, "threads_ran": 1}

    def close(self):
        pass

    interrupt = close


@pytest.fixture
def cards():
    """Leave the shipped weights' cards as they were: here `weights record` has runs of two problems."""
    before = {path: path.read_bytes() for path in REPOSITORY.glob("*/**/weights/*.json") if ".venv" not in path.parts}
    yield
    for path, content in before.items():
        if path.read_bytes() != content:
            path.write_bytes(content)


@pytest.mark.parametrize(("page", "line"), list(commands()))
def test_command(workplace, cards, page, line, monkeypatch, capfd):
    line = line.split("  #")[0].strip()
    if line.startswith("make "):
        target = line.split()[1]
        assert subprocess.run(["make", "-n", target], cwd=REPOSITORY, capture_output=True).returncode == 0
        return
    if line.startswith(SET_UP):
        return
    words = shlex.split(line)
    if words[0] == "python":
        assert (REPOSITORY / words[1]).is_file(), f"{page}: {line}"
        return
    assert words[0] == "regbench", f"{page}: {line} is not a command of ours"
    if words[1] == "run":
        words = [*_without_limit(words), "--limit", "2"]
    if words[1] == "train" and "--steps" not in words:
        words += ["--steps", "2", "--set", "method.validated=1"]
    if words[1:3] == ["new", "method"]:  # two pages show it, and it overwrites nothing
        shutil.rmtree(workplace / words[3], ignore_errors=True)
    if page == RESULTS:
        monkeypatch.chdir(workplace)
        monkeypatch.setenv("REGBENCH_DATA", "data")
        monkeypatch.setattr(lane, "WorkerProcess", AnswersIdentity)
        assert main(words[1:]) == 0, f"{line}\n{capfd.readouterr().err}"
        return
    environment = os.environ | {"REGBENCH_DATA": "data"}
    answer = subprocess.run(
        [sys.executable, "-m", *words], cwd=workplace, env=environment, capture_output=True, text=True, timeout=300
    )
    assert answer.returncode == FAILS_ON_PURPOSE.get(line, 0), f"{page}: {line}\n{answer.stdout}\n{answer.stderr}"


def _without_limit(words):
    if "--limit" not in words:
        return words
    position = words.index("--limit")
    return words[:position] + words[position + 2 :]


def test_every_page_is_linked():
    linked = "".join(page.read_text() for page in PAGES)
    for page in PAGES[1:]:
        assert page.name in linked.replace(page.read_text(), ""), f"nothing links to {page.name}"
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name} links to {target}, which is not there"
