"""Makes run folders of explicit rows, as the runner writes them."""

import hashlib
import json

import numpy as np

from regbench.geometry.se3 import rotation_from_euler_deg, se3


def motion(angles_deg=(0, 0, 0), translation=(0, 0, 0)):
    return se3(rotation_from_euler_deg(angles_deg), translation)


def sha(text):
    return hashlib.sha256(text.encode()).hexdigest()


def method(name, kind="classical", sees_ground_truth=False, version="1"):
    return {
        "method": name,
        "name": name.split("[")[0],
        "kind": kind,
        "sees_ground_truth": sees_ground_truth,
        "deterministic": True,
        "parameters": {},
        "version": version,
        "fingerprint": sha(f"{name} {version}"),
    }


def protocol(id, truths, *, n=None, published=None, headline=("rmse_r_deg", "rmse_t", "mae_r_deg", "mae_t"), data=""):
    return {
        "id": id,
        "description": f"made for a test & 100 % synthetic ({id.split('@')[0]})",
        "dataset": None,
        "sha256": sha(f"{id} {data}"),
        "n": len(truths) if n is None else n,
        "headline_metrics": list(headline),
        "published": published,
        "truths": truths,
    }


def row(method, protocol, problem, T=None, *, status="ok", repeat=0, time_ms=None, cpu_ms=None, error=None):
    """A row of the journal; T is the answer of a trial whose status is ok."""
    key = sha(f"{method['fingerprint']} {protocol['sha256']} {problem} {repeat}")[:32]
    return {
        "key": key,
        "method": method["method"],
        "protocol": protocol["id"],
        "problem": problem,
        "repeat": repeat,
        "status": status,
        "T_target_source": None if T is None else np.asarray(T).tolist(),
        "time_ms": time_ms,
        "cpu_ms": time_ms if cpu_ms is None else cpu_ms,
        "error": error,
        "converged": None,
        "iterations": None,
        "confidence": None,
        "stages_s": {},
        "threads_ran": 1,
        "peak_rss_mb": 100.0,
        "fingerprint": method["fingerprint"],
        "protocol_sha256": protocol["sha256"],
        "host": "host",
    }


def write_run(folder, methods, protocols, rows, *, repeat=1, cpu="Test CPU", seed=0, threads=1):
    """Write a run folder and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    manifest = {
        "regbench_version": "0.1.0",
        "command": ["regbench", "run"],
        "config": {"repeat": repeat, "seed": seed, "threads": threads, "device": "cpu"},
        "seed": 0,
        "hardware": {"hostname": "host", "cpu": cpu, "cores": 2},
        "methods": methods,
        "protocols": [{key: value for key, value in p.items() if key != "truths"} for p in protocols],
    }
    (folder / "manifest.json").write_text(json.dumps(manifest))
    (folder / "trials.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows))
    problems = [
        {"protocol": p["id"], "problem": i, "T_target_source": None if T is None else T.tolist(), "label": "", "id": ""}
        for p in protocols
        for i, T in enumerate(p["truths"])
    ]
    (folder / "problems.jsonl").write_text("".join(json.dumps(p) + "\n" for p in problems))
    return folder


def example_run(folder):
    """A run whose every figure can be checked by hand: four problems on demo@1 and on modelnet40/clean@1.

    Truths turn 10, 20, 30, 40 deg about x; the translation is 0.1 along x. So an answer (or a failure, scored as the
    identity) is off by a known angle and length.
    """
    truths = [motion((angle, 0, 0), (0.1, 0, 0)) for angle in (10, 20, 30, 40)]
    demo = protocol("demo@1", truths)
    clean = protocol("modelnet40/clean@1", truths, published="modelnet40_same")
    icp, tied, odd, failing, unfinished, oracle, identity = methods = [
        method("icp"),
        method("icp[max_distance=0.5]"),
        method("od_d%[a&b=#1,c={x}]"),
        method("failing"),
        method("unfinished"),
        method("oracle", kind="sentinel", sees_ground_truth=True),
        method("identity", kind="sentinel"),
    ]
    rows = []
    for problem, angle in enumerate((10, 20, 30, 40)):
        near = motion((angle + 2, 0, 0), (0.1, 0, 0))
        far = motion((angle, 6, 0), (0.1, 0, 0.2))
        for p in (demo, clean):
            rows += [
                row(icp, p, problem, near, time_ms=1.0 + problem),
                row(tied, p, problem, near, time_ms=2.0 + problem),
                row(odd, p, problem, far, time_ms=0.5),
                row(oracle, p, problem, truths[problem], time_ms=0.01),
                row(identity, p, problem, np.eye(4), time_ms=0.02),
            ]
        if problem < 2:
            rows.append(row(unfinished, demo, problem, truths[problem], time_ms=0.1))
    for problem, status in enumerate(("timeout", "crashed", "invalid", "timeout")):
        rows.append(row(failing, demo, problem, status=status, error="why"))
    rows.append(row(failing, clean, 0, truths[0], time_ms=9.0))
    rows += [row(failing, clean, problem, status="oom", error="why") for problem in (1, 2, 3)]
    return write_run(folder, methods, [demo, clean], rows)
