"""A random view keeps pixels and labels together."""

from __future__ import annotations

import numpy as np

from pipeline.training.augment import other_light, view

SIZE = (192, 320)


def test_the_box_still_surrounds_its_vehicle_in_every_view() -> None:
    image = np.full((360, 640, 3), 40, np.uint8)
    image[150:190, 200:260] = 220
    rows = np.array([[0, 1, 200, 150, 260, 190, 1.0, 30.0]], dtype=np.float32)
    rng, seen = np.random.default_rng(0), 0
    for _ in range(60):
        window, cut = view(rng, image, rows, SIZE)
        assert window.shape == (*SIZE, 3)
        x1, y1, x2, y2 = cut[0, 2:6]
        bright = np.nonzero(window.mean(axis=2) > (window.max() / 2 + window.min() / 2))
        if cut[0, 6] < 0.99:
            continue
        seen += 1
        middle = (x1 + x2) / 2, (y1 + y2) / 2
        assert np.allclose((np.median(bright[1]), np.median(bright[0])), middle, atol=3.0)
        assert 0.7 < (y2 - y1) / 40 < 1.4
    assert seen > 15


def test_a_vehicle_outside_the_window_is_not_visible() -> None:
    image = np.zeros((360, 640, 3), np.uint8)
    rows = np.array([[0, 0, 0, 0, 20, 20, 1.0, 5.0], [0, 0, 620, 340, 640, 360, 0.5, 5.0]], dtype=np.float32)
    rng = np.random.default_rng(1)
    shares = np.array([view(rng, image, rows, SIZE)[1][:, 6] for _ in range(40)])
    assert np.all(shares.min(axis=1) == 0.0)
    assert shares[:, 1].max() <= 0.5


def test_light_differs_from_view_to_view_and_follows_the_seed() -> None:
    image = np.full((32, 32, 3), 128, np.uint8)
    levels = [other_light(np.random.default_rng(seed), image).mean() for seed in (1, 1, 2, 3)]
    assert levels[0] == levels[1]
    assert len(set(levels)) == 3
