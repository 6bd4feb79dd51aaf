"""The renderer: what is nearer hides what is farther, aligned clouds show both colours, files are whole."""

import numpy as np
import pytest
from PIL import Image

from regbench.errors import UserError
from regbench.report.picture import SOURCE_COLOUR, TARGET_COLOUR, best_view, render_pair, save_before_after
from tests.report.helpers import motion


def cloud(n=300, seed=0):
    return np.random.default_rng(seed).normal(size=(n, 3))


def panels(image):
    pixels = np.asarray(image).astype(int)
    # Below the words in the corner, beside the line between the panels.
    return pixels[60:, :590], pixels[60:, 610:]


def orange(pixels):
    return (pixels[..., 0] > pixels[..., 2] + 40).sum()


def blue(pixels):
    return (pixels[..., 2] > pixels[..., 0] + 40).sum()


def test_a_picture_is_two_panels_on_white():
    image = render_pair([(cloud(), SOURCE_COLOUR)], [(cloud(), TARGET_COLOUR)])
    assert image.size == (1200, 600)
    before, after = panels(image)
    assert orange(before) > 1000
    assert blue(before) == 0
    assert blue(after) > 1000
    assert orange(after) == 0
    assert (np.asarray(image)[-5:, :5] == 255).all()


def test_the_same_clouds_give_the_same_pixels():
    first, second = (render_pair([(cloud(), SOURCE_COLOUR)], [(cloud(), TARGET_COLOUR)]) for _ in range(2))
    assert np.array_equal(first, second)


@pytest.mark.parametrize("order", [1, -1])
def test_the_nearer_cloud_hides_the_farther_one_whatever_the_order(order):
    flat = np.random.default_rng(1).uniform(-1, 1, size=(4000, 2))
    far = np.column_stack([flat, np.zeros(len(flat))])
    view = best_view(far, "z")
    far = far @ view  # a sheet that faces the eye
    near = far + 0.3 * view[2]  # each point in front of one of the sheet's
    clouds = [(far, TARGET_COLOUR), (near, SOURCE_COLOUR)][::order]
    before, _ = panels(render_pair(clouds, clouds))
    assert orange(before) > 20_000
    assert blue(before) < 0.01 * orange(before)


def test_where_clouds_coincide_both_colours_show():
    points = cloud()
    _, after = panels(render_pair([(points, SOURCE_COLOUR)], [(points, SOURCE_COLOUR), (points, TARGET_COLOUR)]))
    assert 1 / 3 < orange(after) / blue(after) < 3


def test_the_colours_differ_in_grey_too():
    red, green, luma = 0.299, 0.587, []
    for colour in (SOURCE_COLOUR, TARGET_COLOUR):
        luma.append(red * colour[0] + green * colour[1] + 0.114 * colour[2])
    assert abs(luma[0] - luma[1]) > 50


@pytest.mark.parametrize("up", ["y", "z"])
def test_every_view_is_a_rotation_that_keeps_up_up(up):
    view = best_view(cloud(), up)
    np.testing.assert_allclose(view @ view.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view) == pytest.approx(1)
    axis = {"y": [0, 1, 0], "z": [0, 0, 1]}[up]
    right, upwards, towards = view @ axis
    assert right == pytest.approx(0, abs=1e-12)
    assert upwards > 0.8
    assert towards > 0  # seen from above


def test_a_saved_picture_can_be_read_and_shows_the_motion(tmp_path):
    source, T = cloud(), motion((0, 0, 80), (6, 0, 0))
    target = source @ T[:3, :3].T + T[:3, 3]
    save_before_after(tmp_path / "pair.png", source, target, T)
    with Image.open(tmp_path / "pair.png") as image:
        assert (image.format, image.size) == ("PNG", (1200, 600))
        before, after = panels(image)
    assert orange(before) > 500
    assert blue(before) > 500
    columns = [np.flatnonzero((p[..., 0] > p[..., 2] + 40).any(axis=0)).mean() for p in (before, after)]
    blues = [np.flatnonzero((p[..., 2] > p[..., 0] + 40).any(axis=0)).mean() for p in (before, after)]
    assert abs(columns[0] - blues[0]) > 100  # apart before
    assert abs(columns[1] - blues[1]) < 20  # together after


def test_one_point_and_a_flat_cloud_can_be_drawn():
    render_pair([(np.zeros((1, 3)), SOURCE_COLOUR)], [(np.zeros((50, 3)), TARGET_COLOUR)])


@pytest.mark.parametrize("bad", [np.empty((0, 3)), np.full((2, 3), np.nan)])
def test_nothing_to_draw_is_refused(bad):
    with pytest.raises(ValueError, match="at least one point in each panel, and finite values alone"):
        render_pair([(bad, SOURCE_COLOUR)], [(cloud(), TARGET_COLOUR)])


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(UserError, match=r"nowhere/pair.png: cannot be written \(No such file"):
        save_before_after(tmp_path / "nowhere" / "pair.png", cloud(), cloud(), np.eye(4))
    with pytest.raises(UserError, match=r"pair.jpg: a picture is saved as PNG"):
        save_before_after(tmp_path / "pair.jpg", cloud(), cloud(), np.eye(4))
