"""Each verb, called with a list of arguments, and what it prints."""

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from regbench.cli.main import main

FAULTY = Path(__file__).parent.parent / "runner" / "faulty_methods.py"


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder of a run of three methods, one of them with failures."""
    out = tmp_path_factory.mktemp("runs") / "small"
    arguments = ["run", "-m", "icp,identity,raises", "--plugin", str(FAULTY), "--limit", "6", "--out", str(out)]
    assert main(arguments) == 0
    return out


def test_run_prints_a_table_and_keeps_it(finished, capsys):
    text = (finished / "tables" / "table.txt").read_text()
    assert "icp" in text
    assert "error" in text, "failures must show"
    assert {"manifest.json", "trials.jsonl", "problems.jsonl", "logs", "tables"} <= {p.name for p in finished.iterdir()}


def test_json_has_the_promised_keys_in_order(finished, capsys):
    assert main(["table", str(finished), "--format", "json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    promised = (
        "method protocol n failures rmse_r_deg rmse_t mae_r_deg mae_t rre_mean_deg rre_median_deg rte_mean rte_median "
        "recall_1deg recall_5deg recall_15deg time_median_ms time_p95_ms cpu_median_ms"
    ).split()
    assert {row["method"] for row in rows} == {"icp", "identity", "raises"}
    for row in rows:
        assert list(row)[: len(promised)] == promised
        assert row["n"] == 6
    failures = {row["method"]: row["failures"] for row in rows}
    assert failures["icp"] == {}
    assert set(failures["raises"]) == {"error"}


def test_a_failed_trial_is_scored_as_the_identity(finished, capsys):
    main(["table", str(finished), "--format", "json"])
    rows = {row["method"]: row for row in json.loads(capsys.readouterr().out)}
    for key in ("rmse_r_deg", "rmse_t", "mae_r_deg", "mae_t", "rre_median_deg"):
        assert rows["raises"][key] == rows["identity"][key]


@pytest.mark.parametrize("style", ["text", "csv", "markdown", "latex", "json"])
def test_every_format_names_every_method(finished, capsys, style):
    assert main(["table", str(finished), "--format", style]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in ("icp", "identity", "raises"))
    if style == "csv":
        assert len(list(csv.DictReader(io.StringIO(text)))) == 3


def test_the_latest_run_is_the_default(here, capsys):
    assert main(["run", "-m", "identity", "--limit", "2"]) == 0
    assert main(["run", "-m", "oracle", "--limit", "2"]) == 0
    capsys.readouterr()
    assert main(["table", "--format", "json"]) == 0
    assert [row["method"] for row in json.loads(capsys.readouterr().out)] == ["oracle"]


def test_a_configuration_file_and_the_command_line_over_it(here, capsys):
    Path("run.toml").write_text('method = "identity"\nlimit = 4\nrepeat = 2\ntimeout = 5\n')
    assert main(["run", "--config", "run.toml", "--limit", "3", "--out", "run"]) == 0
    manifest = json.loads(Path("run/manifest.json").read_text())
    assert (manifest["config"]["limit"], manifest["config"]["repeat"], manifest["config"]["timeout"]) == (3, 2, 5.0)
    assert len(Path("run/trials.jsonl").read_text().splitlines()) == 6


def test_sweeps_become_rows(here, capsys):
    assert main(["run", "-m", "icp[max_iterations=1,60]", "--limit", "2", "--out", "run"]) == 0
    capsys.readouterr()
    main(["table", "run", "--format", "json"])
    methods = [row["method"] for row in json.loads(capsys.readouterr().out)]
    assert methods == ["icp[max_iterations=1]", "icp[max_iterations=60]"]


@pytest.mark.parametrize("what", ["methods", "protocols", "datasets", "metrics"])
def test_ls(here, capsys, what):
    assert main(["ls", what, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    names = {row["name"] for row in rows}
    some = {"methods": "icp", "protocols": "demo@1", "datasets": "cad_demo", "metrics": "rmse_r_deg"}
    assert some[what] in names
    assert main(["ls", what]) == 0
    assert some[what] in capsys.readouterr().out


def test_what_is_not_prepared_is_listed_with_what_to_do(here, capsys):
    assert main(["ls", "protocols"]) == 0
    text = capsys.readouterr().out
    assert "not ready" in text
    assert "regbench data prepare modelnet40" in text


def test_a_broken_plugin_is_listed_with_its_reason(here, capsys):
    Path("broken.py").write_text("import a_package_that_nobody_has\n")
    assert main(["ls", "methods", "--plugin", "broken.py", "--plugin", "gone.py"]) == 0
    text = capsys.readouterr().out
    assert "a_package_that_nobody_has" in text
    assert "gone.py: no such file" in text
    assert "icp" in text


def test_doctor(here, capsys):
    assert main(["doctor", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["packages"]["open3d"] == "imports"
    assert report["methods"]["icp"] == "ready"
    assert report["compiled code"]["kept in"].endswith("(writable)")
    assert "first answer" in report["compiled code"]["our ICP"]
    assert "regbench data prepare" in report["data"]["modelnet40"]


def test_check_passes_for_icp_and_fails_for_a_liar(here, capsys):
    Path("liar.py").write_text(
        "import numpy as np\nfrom regbench import Registration\n"
        "class Liar:\n    name = 'liar'\n    deterministic = True\n"
        "    def register(self, problem):\n"
        "        T = np.eye(4)\n        T[:3, 3] = np.random.default_rng().normal(size=3)\n"
        "        return Registration(T_target_source=T)\n"
    )
    assert main(["check", "identity"]) == 0
    assert "identity: conforms" in capsys.readouterr().out
    assert main(["check", "liar", "--plugin", "liar.py"]) == 1
    assert "failed" in capsys.readouterr().out


def test_new_method_passes_its_own_check(here, capsys):
    assert main(["new", "method", "my_icp"]) == 0
    plugin = next(
        Path(line) for line in capsys.readouterr().out.splitlines() if line.endswith("my_icp.py") and "test" not in line
    )
    assert main(["check", "my_icp", "--plugin", str(plugin)]) == 0
    assert main(["run", "-m", "my_icp,identity", "--plugin", str(plugin), "--limit", "3"]) == 0


def test_align_two_files(here, capsys, shared_data):
    kitti = shared_data / "extras" / "kitti"
    arguments = ["align", str(kitti / "source.ply"), str(kitti / "target.ply"), "--method", "small_gicp,identity"]
    assert main([*arguments, "--save", "aligned.ply", "--picture", "pair.png", "--json"]) == 0
    answers = {answer["method"]: answer for answer in json.loads(capsys.readouterr().out)}
    assert answers["small_gicp"]["best"]
    truth = np.loadtxt(kitti / "T_target_source.txt")
    assert np.abs(np.array(answers["small_gicp"]["T_target_source"]) - truth)[:3, 3].max() < 0.1
    from regbench.datasets.readers.cloud import read_cloud

    moved, source = read_cloud(Path("aligned.ply")), read_cloud(kitti / "source.ply")
    T = np.array(answers["small_gicp"]["T_target_source"])
    np.testing.assert_allclose(moved, source @ T[:3, :3].T + T[:3, 3], atol=1e-4)
    assert Path("pair.png").read_bytes().startswith(b"\x89PNG")


def test_a_method_that_fails_in_align_says_why(here, capsys):
    np.save("a.npy", np.random.default_rng(0).normal(size=(50, 3)))
    assert main(["align", "a.npy", "a.npy", "-m", "answers_none,needs", "--plugin", str(FAULTY)]) in (0, 1)
    assert "needs: missing: needs a_package_that_nobody_has" in capsys.readouterr().out


def test_pairs_of_one_s_own(here, capsys):
    rng = np.random.default_rng(0)
    cloud = rng.normal(size=(300, 3)) * (1, 2, 3)
    T = np.eye(4)
    T[:3, 3] = 0.1, 0.2, 0.0
    Path("mine").mkdir()
    np.save("mine/a.npy", cloud)
    np.save("mine/b.npy", cloud + T[:3, 3])
    np.savetxt("mine/T.txt", T)
    Path("mine/pairs.csv").write_text("source,target,T_target_source\na.npy,b.npy,T.txt\na.npy,a.npy,\n")
    assert main(["run", "-m", "icp", "-p", "pairs:mine", "--out", "run"]) == 0
    capsys.readouterr()
    main(["table", "run", "--format", "json"])
    row = json.loads(capsys.readouterr().out)[0]
    assert row["failures"] == {}
    assert row["rre_median_deg"] < 1e-6


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ([], "doctor"),
        (["data"], "prepare"),
        (["run", "--help"], "--limit"),
        (["data", "get", "--help"], "7scenes, modelnet40, modelnet40-meshes"),
        (["data", "prepare", "--help"], "7scenes, modelnet40."),
    ],
)
def test_help(capsys, arguments, word):
    assert main(arguments) == 0
    text = capsys.readouterr().out
    assert text.startswith("Usage:")
    assert word in text
