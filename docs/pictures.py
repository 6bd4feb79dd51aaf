"""Makes the pictures of README and docs: python docs/pictures.py."""

import json
import re
from pathlib import Path

import matplotlib

matplotlib.use("agg")

from matplotlib import pyplot
from PIL import Image

from regbench.registry import MethodRegistry, find_protocol, parse_methods
from regbench.report.picture import save_before_after

DOCS = Path(__file__).parent
PROTOCOL, PROBLEM, METHOD = "demo@1", 5, "fgr"
ORANGE, BLUE = "#E68200", "#0068B2"
# Table 1 of the LatentCEM paper, Go-ICP without noise: RMSE(R) and MAE(R) in degrees.
PUBLISHED_DEG = (11.8523, 2.5884)


def main():
    """Write all pictures."""
    pair(DOCS / "pair.png")
    threshold(DOCS / "results" / "goicp-threshold.json", DOCS / "goicp_threshold.png")


def pair(path):
    """One problem of demo@1, before and after one method."""
    problem, _ = find_protocol(PROTOCOL).open(Path("data")).problem(PROBLEM, protocol=PROTOCOL)
    found = MethodRegistry().resolve(parse_methods([METHOD])[0])
    answer = found.cls(**found.parameters).register(problem)
    save_before_after(path, problem.source, problem.target, answer.T_target_source)
    Image.open(path).quantize(64).save(path, optimize=True)  # a third of the size, and nobody sees it


def threshold(table, path):
    """Go-ICP's errors over the threshold at which it stops, with the paper's figures as lines."""
    searches = {"rotations and translations, at most 5 s": {}, "rotations about matched centroids": {}}
    for row in json.loads(table.read_text()):
        value = float(re.search(r"threshold=([^,\]]+)", row["method"])[1])
        list(searches.values())["motion=centred" in row["method"]][value] = row
    figure, panels = pyplot.subplots(1, 3, figsize=(10, 3), layout="constrained")
    figures = (
        ("rmse_r_deg", "RMSE(R) in degrees", PUBLISHED_DEG[0]),
        ("mae_r_deg", "MAE(R) in degrees", PUBLISHED_DEG[1]),
        ("recall_5deg", "recall (5 deg, 0.05)", None),
    )
    for axes, (key, label, published) in zip(panels, figures, strict=True):
        for (name, rows), colour in zip(searches.items(), (ORANGE, BLUE), strict=True):
            axes.plot(sorted(rows), [rows[value][key] for value in sorted(rows)], "o-", color=colour, label=name)
        if published is not None:
            axes.axhline(published, color="black", linestyle="--", label="the paper's Go-ICP row")
            axes.set_ylim(bottom=0)
        axes.set(xscale="log", xlabel="threshold of the mean squared error", title=label)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    main()
