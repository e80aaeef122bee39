"""A view that `view.py` draws has the colours of its parts. Run with: python -m unittest discover harness/oracles"""

import base64
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import pyvista

HERE = pathlib.Path(__file__).parent
SQUARE = np.dtype([("corner", "<u2", 2), ("level", "u1"), ("colour", "u1")])
RED, BLUE, GREY = [250, 0, 0], [0, 0, 250], [190, 190, 190]


def encoded(array):
    return base64.b64encode(array.tobytes()).decode()


def scene(squares, triangles):
    """A slice through a root of edge 8 at the origin, and triangles of its first corner points."""
    points = np.array([[0, 0, 0.1], [0.4, 0, 0.1], [0, 0.4, 0.1]], "<f4")
    cut = {"name": "z = 4", "axis": 2, "at": 4.0, "level_outlined": 1, "squares": encoded(np.array(squares, SQUARE))}
    colours = np.full(len(triangles), 2, "u1")
    body = {"points": encoded(points), "triangles": encoded(np.array(triangles, "<u4")), "colours": encoded(colours)}
    return {
        "quantity": "level",
        "legend": [["1", RED], ["2", BLUE]],
        "colours": [RED, BLUE, GREY],
        "root": {"origin": [0.0, 0.0, 0.0], "edge": 8.0},
        "window": [[4.0, 4.0, 4.0], 8.0],
        "slices": [cut],
        "body": body,
    }


def pixels(view):
    with tempfile.TemporaryDirectory() as place:
        path, picture = pathlib.Path(place) / "scene.json", pathlib.Path(place) / "view.png"
        path.write_text(json.dumps(view), encoding="utf-8")
        subprocess.run([sys.executable, "-B", HERE / "view.py", path, picture], check=True, capture_output=True)
        return pyvista.read(picture).active_scalars.reshape(-1, 3).astype(int)


class View(unittest.TestCase):
    def test_squares_and_triangles_have_their_colours(self):
        half = 1 << 15
        squares = [((0, 0), 1, 0), ((half, 0), 1, 0), ((0, half), 1, 1), ((half, half), 2, 1)]
        image = pixels(scene(squares, [[0, 1, 2]]))
        self.assertEqual(len(image), 1600 * 1000)
        share = [(np.abs(image - colour).max(axis=1) < 8).mean() for colour in (RED, BLUE)]
        self.assertGreater(share[0], 0.1)
        self.assertGreater(share[1], 0.05)
        # Shading keeps the hue of the body.
        grey = (np.ptp(image, axis=1) < 12) & (image[:, 0] > 90) & (image[:, 0] < 235)
        self.assertGreater(grey.mean(), 0.01)

    def test_a_view_without_body_or_slices_is_drawn(self):
        empty = scene([], [])
        self.assertGreater(pixels(empty | {"body": None}).mean(), 250)
        self.assertGreater(pixels(empty | {"slices": []}).mean(), 250)


if __name__ == "__main__":
    unittest.main()
