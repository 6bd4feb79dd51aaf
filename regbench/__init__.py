"""regbench: point cloud registration methods, measured on named protocols.

The names a method's author needs are importable from here. They are looked up on first use, so that
`import regbench` costs nothing and a worker process can set its affinity before numpy is loaded.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from regbench.contract import MotionPrior, Problem, Registrar, Registration

__version__ = "0.1.0"
__all__ = ["MotionPrior", "Problem", "Registrar", "Registration"]


def __getattr__(name: str) -> object:
    if name in __all__:
        from regbench import contract

        return getattr(contract, name)
    raise AttributeError(f"module 'regbench' has no attribute {name!r}")
