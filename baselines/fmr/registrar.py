"""FMR as a method."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from regbench.learning.weight_files import WeightFiles

from ..pointnetlk.registrar import PointNetLk

FILES = WeightFiles("fmr", Path(__file__).parent / "weights", default="modelnet40")


class Fmr(PointNetLk):
    """FMR (Huang et al. 2020): the source is moved until its feature, learned by rebuilding clouds, is the target's.

    Encoder and loop are PointNetLK's, and so are the arguments; see there. The training is another: without the true
    motions.
    """

    name = "fmr"
    files: ClassVar[WeightFiles] = FILES
