"""LatentCEM as a plugin file, until its weights are there and an entry point can name it.

regbench run --plugin benchmarks/latentcem_plugin.py --method "latentcem[model=equivariant]" \
    --protocol modelnet40/clean@1,modelnet40/noise@1 --limit 150
"""

from regbench_latentcem.registrar import LatentCem


class LatentCemPlugin(LatentCem):
    """The same under a name of this file, which is where plugins are looked for."""
