"""Fuzzes everything that reads files from outside: only UserError may come out. Figures to docs/security.md.

    python benchmarks/fuzz.py ply --inputs 100000
    python benchmarks/fuzz.py all --inputs 100000

Valid files, real ones where REGBENCH_SHARED_DATA has them, are damaged by seeded mutations (fuzz_mutations.py) and
read. A finding is any other exception, a warning, a message of two lines, more than 5 s, more than 1 GB of memory above
the start, or, where an archive is unpacked, a file outside its folder. What is found is printed with the input's number
and kept in --keep; exit code 1.

With --atheris (pip install atheris; not one of regbench's own dependencies) the mutations are led by coverage instead.
"""

import argparse
import io
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from fuzz_mutations import damaged

if "--atheris" in sys.argv:  # it can only follow what is imported after it
    import atheris

    atheris.instrument_imports(include=["regbench", "regbench_data_prep"]).__enter__()

from fuzz_targets import TARGETS

from regbench.errors import UserError

HANG_S, MEMORY_BYTES = 5, 2**30


class TooLongError(BaseException):
    """Not an Exception: what catches those must not hide a hang."""


def _too_long(number, frame):
    raise TooLongError


def fuzz(name: str, inputs: int, seed: int, keep: Path | None) -> int:
    """Read so many damaged inputs; print what was found; return the number of different findings."""
    target = TARGETS[name]
    seeds = target.seeds()
    found: dict[str, int] = {}
    read = refused = 0
    slowest_s, start = 0.0, time.perf_counter()
    signal.signal(signal.SIGALRM, _too_long)
    rss_before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        for number in range(-len(seeds), inputs):
            draw = random.Random(f"{name} {seed} {number}")
            data = seeds[number + len(seeds)] if number < 0 else damaged(draw.choice(seeds), seeds, draw)
            began = time.perf_counter()
            signal.alarm(HANG_S)
            try:
                with warnings.catch_warnings(), redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                    warnings.simplefilter("error")
                    target.read(Path(folder), data)
                read += 1
                words = ""
            except UserError as error:
                refused += 1
                words = "" if "\n" not in str(error) else f"two lines: {error}"
            except (Exception, TooLongError, SystemExit) as error:  # noqa: BLE001 - whatever it is, it is a finding
                last = [frame for frame in traceback.extract_tb(error.__traceback__) if "regbench" in frame.filename][
                    -1:
                ]
                where = f"{Path(last[0].filename).name}:{last[0].lineno}" if last else "?"
                words = f"{type(error).__name__} at {where}: {str(error)[:150]!r}"
                key = f"{type(error).__name__} at {where}"
            finally:
                signal.alarm(0)
            if words:
                key = words if words.startswith("two lines") else key
                found[key] = found.get(key, 0) + 1
                if found[key] == 1:
                    print(f"  {name}, input {number}: {words}", flush=True)
                    if keep:
                        keep.mkdir(parents=True, exist_ok=True)
                        (keep / f"{name}-{number}").write_bytes(data)
            slowest_s = max(slowest_s, time.perf_counter() - began)
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - rss_before)
    if grown > MEMORY_BYTES:
        found["memory"] = 1
    print(
        f"{name}: {inputs} inputs of {len(seeds)} files, {refused} refused, {read} read, {len(found)} findings; "
        f"slowest {slowest_s:.2f} s, memory grew by {grown / 2**20:.0f} MB, {time.perf_counter() - start:.0f} s",
        flush=True,
    )
    return len(found)


def fuzz_by_coverage(name: str, inputs: int) -> None:
    """Let atheris choose the inputs; it ends the process at the first finding, with the input in a file crash-..."""
    target = TARGETS[name]
    folder, corpus = Path(tempfile.mkdtemp(dir="/dev/shm")), Path(tempfile.mkdtemp())
    for number, data in enumerate(target.seeds()):
        (corpus / str(number)).write_bytes(data)

    def one_input(data: bytes) -> None:
        try:
            target.read(folder, data)
        except UserError as error:
            if "\n" in str(error):
                raise RuntimeError("two lines") from error

    options = [
        f"-runs={inputs}",
        f"-timeout={HANG_S}",
        "-rss_limit_mb=4096",
        "-max_len=20000",
        "-verbosity=0",
        "-print_final_stats=1",
    ]
    atheris.Setup([sys.argv[0], *options, str(corpus)], one_input)
    atheris.Fuzz()


def main() -> int:
    """Fuzz what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("target", choices=[*TARGETS, "all"], nargs="+")
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder for inputs that found something")
    parser.add_argument("--atheris", action="store_true", help="choose inputs by coverage")
    given = parser.parse_args()
    names = list(TARGETS) if "all" in given.target else given.target
    if given.atheris:
        fuzz_by_coverage(names[0], given.inputs)
    return int(sum(fuzz(name, given.inputs, given.seed, given.keep) for name in names) > 0)


if __name__ == "__main__":
    sys.exit(main())
