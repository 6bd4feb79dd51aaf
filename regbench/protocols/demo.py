"""The protocol that needs no data."""

from regbench.protocols.shapes import ShapeProtocol

DEMO = ShapeProtocol(
    name="demo",
    version=1,
    description="procedural CAD shapes, 784 points, independent noise on both clouds; needs no data",
    dataset="cad_demo",
    kind="noise",
    shape_points=784,
)
