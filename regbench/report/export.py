"""Trials in formats of other tools: CSV, JSON, Parquet, and the results file of the BOP challenge."""

from __future__ import annotations

import csv
import importlib.util
import io
import json
from collections.abc import Iterable, Sequence

from regbench.errors import UserError
from regbench.report.trial_records import Record

FORMATS = ("csv", "json", "parquet", "bop")
# T_target_source in a flat file: T_00 to T_33, by row.
ENTRIES = tuple(f"T_{row}{column}" for row in range(4) for column in range(4))
# BOP counts lengths in millimetres and times in seconds.
MM_PER_LENGTH = 1000.0
NO_TIME_S = -1.0


def export(records: Iterable[Record], format: str) -> bytes:
    """Return the content of a file with all records; numbers come back from it bit for bit.

    Args:
        records: As trial_records.py yields them.
        format: One of FORMATS.

    Raises:
        UserError: Parquet without pyarrow; or BOP, whose file has no column for it, and more than one method.
    """
    return {"csv": _csv, "json": _json, "parquet": _parquet, "bop": _bop}[format](list(records))


def _csv(records: Sequence[Record]) -> bytes:
    file = io.StringIO()
    writer = csv.DictWriter(file, _columns(records), lineterminator="\n")
    writer.writeheader()
    writer.writerows(map(_flat, records))
    return file.getvalue().encode()


def _json(records: Sequence[Record]) -> bytes:
    return ("[\n" + ",\n".join(json.dumps(record) for record in records) + "\n]\n").encode()


def _parquet(records: Sequence[Record]) -> bytes:
    if importlib.util.find_spec("pyarrow") is None:
        raise UserError('--format parquet needs pyarrow, which is not installed: pip install "regbench[parquet]"')
    import pyarrow
    from pyarrow import parquet

    flat = list(map(_flat, records))
    table = pyarrow.table({name: [record[name] for record in flat] for name in _columns(records)})
    sink = pyarrow.BufferOutputStream()
    parquet.write_table(table, sink)
    content: bytes = sink.getvalue().to_pybytes()
    return content


def _bop(records: Sequence[Record]) -> bytes:
    """Write a row for each trial that answered, of the first repeat: scene_id,im_id,obj_id,score,R,t,time.

    scene_id counts the protocols from 1 in the order of the records, im_id is the problem, obj_id and score are 1, R
    (by row) and t are those of T_target_source.
    """
    methods = sorted({record["method"] for record in records})
    if len(methods) > 1:
        raise UserError(f"--format bop: a file is of one method; choose by --method one of {', '.join(methods)}")
    scenes = {name: number for number, name in enumerate(dict.fromkeys(r["protocol"] for r in records), start=1)}
    lines = ["scene_id,im_id,obj_id,score,R,t,time"]
    for record in records:
        T = record["T_target_source"]
        if T is None or record["repeat"] > 0:
            continue
        R = " ".join(repr(entry) for row in T[:3] for entry in row[:3])
        t = " ".join(repr(row[3] * MM_PER_LENGTH) for row in T[:3])
        time_s = NO_TIME_S if record["time_ms"] is None else record["time_ms"] / 1000
        lines.append(f"{scenes[record['protocol']]},{record['problem']},1,1,{R},{t},{time_s!r}")
    return ("\n".join(lines) + "\n").encode()


def _columns(records: Sequence[Record]) -> list[str]:
    named = [name for name in records[0] if name != "T_target_source"] if records else []
    return [*named, *ENTRIES]


def _flat(record: Record) -> Record:
    T = record["T_target_source"]
    entries = [None] * len(ENTRIES) if T is None else [entry for row in T for entry in row]
    named = {name: value for name, value in record.items() if name != "T_target_source"}
    return {**named, **dict(zip(ENTRIES, entries, strict=True))}
