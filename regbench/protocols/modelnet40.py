"""The protocols on ModelNet40's test shapes (REFERENCES: DCP, PRNet, RPM-Net, and the paper's 784 points)."""

from regbench.protocols.shapes import ShapeProtocol

CLEAN = ShapeProtocol(
    name="modelnet40/clean",
    version=1,
    description="the paper's table: 784 points, target = permuted exact copy after the motion",
    dataset="modelnet40",
    published="modelnet40_same",
    kind="clean",
    shape_points=784,
)

NOISE = ShapeProtocol(
    name="modelnet40/noise",
    version=1,
    description="784 points, independent noise (0.01, clipped at 0.05) on both clouds (PRNet's)",
    dataset="modelnet40",
    published="modelnet40_noise",
    kind="noise",
    shape_points=784,
)

NOISE_SHARED = ShapeProtocol(
    name="modelnet40/noise-shared",
    version=1,
    description="784 points, noise added before the copy, so that both clouds carry the same (DCP's)",
    dataset="modelnet40",
    kind="noise-shared",
    shape_points=784,
)

UNSEEN = ShapeProtocol(
    name="modelnet40/unseen",
    version=1,
    description="as clean, on the last 20 categories alone",
    dataset="modelnet40",
    kind="clean",
    shape_points=784,
    first_label=20,
)

RESAMPLED = ShapeProtocol(
    name="modelnet40/resampled",
    version=1,
    description="512 + 512 points of one shape: source and target share no point; no noise",
    dataset="modelnet40",
    kind="resampled",
    shape_points=1024,
)

PARTIAL = ShapeProtocol(
    name="modelnet40/partial",
    version=1,
    description="1,024 points, each cloud cut to 70 % (717) by its own half-space, noise on both (RPM-Net's)",
    dataset="modelnet40",
    headline_metrics=("rre_mean_deg", "rte_mean", "mae_r_deg", "mae_t"),
    kind="partial",
    shape_points=1024,
)
