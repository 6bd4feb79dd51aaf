"""PointNetLK (Aoki et al. 2019): PointNet features, aligned by Lucas and Kanade's method."""
