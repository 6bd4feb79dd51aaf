"""What a table needs of a run's manifest: its methods, its protocols, the machine."""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from regbench.errors import UserError
from regbench.runner.hardware import machine_words

SETTINGS = ("seed", "threads", "device")


@dataclass(frozen=True)
class MethodInfo:
    """A method of a run: its name as asked for, its kind, the hash that says which rows are its own, and its settings.

    Settings are what of a run's options changes answers or times: seed, threads, device and, of a method that answered
    several problems at once, how many, in words. `training` is how its weights were trained, in words, or None. `batch`
    is the number of problems that it answered at a time.
    """

    method: str
    kind: str
    sees_ground_truth: bool
    fingerprint: str
    settings: str = ""
    training: str | None = None
    batch: int = 1


@dataclass(frozen=True)
class ProtocolInfo:
    """A protocol of a run.

    Attributes:
        id: Name and version, e.g. "modelnet40/clean@1".
        label: What tables call it: the id, unless two protocols of one id stand side by side.
        description: One line.
        dataset: Name of its dataset, or None.
        sha256: Hash over its problems.
        data_sha256: Identity of its data, or None if the manifest does not say.
        n: Number of problems planned.
        headline_metrics: Keys of the metrics that its paper prints.
        published: The column group of the paper's table that it stands beside, or None.
    """

    id: str
    label: str
    description: str
    dataset: str | None
    sha256: str
    data_sha256: str | None
    n: int
    headline_metrics: tuple[str, ...]
    published: str | None

    @property
    def name(self) -> str:
        """The id without its version."""
        return self.id if self.id.startswith("pairs:") else self.id.rpartition("@")[0] or self.id


@dataclass(frozen=True)
class Manifest:
    """A run's manifest, by name as asked for and by protocol id; `machines` are the processors that ran trials."""

    methods: Mapping[str, MethodInfo]
    protocols: Mapping[str, ProtocolInfo]
    repeat: int
    machines: tuple[str, ...]
    device: str


def read_manifest(run_dir: Path) -> Manifest:
    """Read manifest.json of a run folder.

    Raises:
        UserError: It is missing, damaged or not a run's.
    """
    path = run_dir / "manifest.json"
    try:
        content = json.loads(path.read_bytes())
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); is this the folder of a run?") from error
    except ValueError as error:
        raise UserError(f"{path}: is not JSON ({error}); the file was damaged. Give the run's command again") from error
    try:
        return _parse(content)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        what = f"has no {error}" if isinstance(error, KeyError) else str(error)
        raise UserError(f"{path}: is not a run's manifest ({what})") from None


def _parse(content: Mapping[str, Any]) -> Manifest:
    rows, config = content["methods"], content["config"]
    settings = ", ".join(f"{option} {config[option]}" for option in SETTINGS if option in config)
    methods = {
        _name(row, "method"): MethodInfo(
            _name(row, "method"),
            _kind(row),
            bool(row["sees_ground_truth"]),
            _text(row, "fingerprint"),
            settings if (batch := _batch(row)) == 1 else f"{settings}, batch {batch}",
            _text_or_none(row, "training"),
            batch,
        )
        for row in rows
    }
    protocols = {
        _name(row, "id"): ProtocolInfo(
            id=_name(row, "id"),
            label=_name(row, "id"),
            description=_text(row, "description"),
            dataset=_text_or_none(row, "dataset"),
            sha256=_text(row, "sha256"),
            data_sha256=_text_or_none(row, "data_sha256"),
            n=int(row["n"]),
            headline_metrics=tuple(map(str, row["headline_metrics"])),
            published=_text_or_none(row, "published"),
        )
        for row in content["protocols"]
    }
    hardware = [content["hardware"], *content.get("also_measured_on", [])]
    machines = tuple(dict.fromkeys(machine_words(machine) for machine in hardware))
    return Manifest(methods, protocols, int(config.get("repeat", 1)), machines, str(config.get("device", "cpu")))


def _text(row: Mapping[str, Any], key: str) -> str:
    if not isinstance(value := row[key], str):
        raise TypeError(f"'{key}' is no text")
    return value


def _name(row: Mapping[str, Any], key: str) -> str:
    """Return what stands in every table, which a terminal must print and not obey."""
    name = _text(row, key)
    if any(unicodedata.category(character) == "Cc" for character in name):
        raise ValueError(f"'{key}' has control characters: {name!r}")
    return name


def _text_or_none(row: Mapping[str, Any], key: str) -> str | None:
    return None if row.get(key) is None else _text(row, key)


def _batch(row: Mapping[str, Any]) -> int:
    if not isinstance(batch := row.get("batch", 1), int) or batch < 1:
        raise ValueError("a method's 'batch' is no number of problems")
    return batch


def _kind(row: Mapping[str, Any]) -> str:
    kind = _text(row, "kind")
    if kind == "published":
        raise ValueError("a method is of kind 'published', which the paper's rows are")
    return kind
