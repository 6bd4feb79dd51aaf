"""Super 4PCS: global alignment by congruent sets of four points."""

from .registrar import Super4Pcs

__all__ = ["Super4Pcs"]
