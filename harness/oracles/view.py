"""Draws a view of a mesh, for `harness picture --view`.

    python view.py SCENE.json OUT.png

SCENE.json is the view that harness/report/src/picture/scene.rs describes: the first slice and the surface of the geometry are
drawn. Exit codes: 0 success; 3 pyvista cannot be imported; any other code is a failure.
"""

import base64
import json
import os
import sys

import numpy as np
import protocol

try:
    import pyvista as pv
except (ImportError, OSError) as error:
    protocol.missing(error)

SQUARE = np.dtype([("corner", "<u2", 2), ("level", "u1"), ("colour", "u1")])
SIZE = (1600, 1000)
# Rows of the legend.
ROWS = 20


def decoded(text, dtype):
    return np.frombuffer(base64.b64decode(text), dtype)


def slice_of(scene, cut):
    """The squares of a slice as quadrilaterals, relative to the window, and which of them have outlines."""
    (centre, edge), root = scene["window"], scene["root"]
    squares = decoded(cut["squares"], SQUARE)
    axes = [[1, 2], [0, 2], [0, 1]][cut["axis"]]
    low = np.array(root["origin"])[axes] + squares["corner"] / 65536 * root["edge"]
    side = root["edge"] / 2.0 ** squares["level"]
    points = np.empty((len(squares), 4, 3))
    points[..., cut["axis"]] = cut["at"]
    for corner, (u, v) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        points[:, corner, axes] = low + side[:, None] * (u, v)
    # Squares end at the window.
    points = (points - centre) / edge
    points[..., axes] = points[..., axes].clip(-0.5, 0.5)
    return points, squares["colour"], squares["level"] <= cut["level_outlined"]


def quads(points, colours):
    """A surface of quadrilaterals with their colours."""
    count = len(points)
    faces = np.column_stack([np.full(count, 4), np.arange(4 * count).reshape(count, 4)])
    mesh = pv.PolyData(points.reshape(-1, 3), faces.ravel())
    mesh.cell_data["colour"] = colours
    return mesh


def body_of(scene, palette):
    body = scene["body"]
    triangles = decoded(body["triangles"], "<u4").reshape(-1, 3)
    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    mesh = pv.PolyData(decoded(body["points"], "<f4").reshape(-1, 3), faces)
    mesh.cell_data["colour"] = palette[decoded(body["colours"], "u1")]
    return mesh


def add_legend(plotter, scene):
    """The quantity and the names of its values in the upper left corner, each on its colour."""
    def line(text, row, column, fill=None):
        light = fill is None or np.dot(fill, (0.3, 0.6, 0.1)) > 128
        position = (20 + 100 * column, SIZE[1] - 60 - 46 * row)
        actor = plotter.add_text(text, position=position, font_size=15, color="black" if light else "white")
        if fill is not None:
            actor.prop.background_color = [c / 255 for c in fill]
            actor.prop.background_opacity = 1.0

    line(scene["quantity"], 0, 0)
    for i, (name, fill) in enumerate(scene["legend"]):
        line(f" {name} ", 1 + i % ROWS, i // ROWS, fill)


def main(scene_path, out):
    with open(scene_path, encoding="utf-8") as file:
        scene = json.load(file)
    palette = np.array(scene["colours"], np.uint8)
    plotter = pv.Plotter(off_screen=True, window_size=SIZE)
    plotter.background_color = "white"
    for cut in scene["slices"][:1]:
        points, colours, outlined = slice_of(scene, cut)
        for drawn in (outlined, ~outlined):
            if drawn.any():
                mesh = quads(points[drawn], palette[colours[drawn]])
                style = {"show_edges": drawn is outlined, "edge_color": "#333333", "line_width": 1}
                plotter.add_mesh(mesh, scalars="colour", rgb=True, lighting=False, **style)
    if scene["body"] and scene["body"]["triangles"]:
        plotter.add_mesh(body_of(scene, palette), scalars="colour", rgb=True, ambient=0.3, diffuse=0.75)
    add_legend(plotter, scene)
    azimuth, elevation = -2.2, 0.55
    eye = [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
    plotter.camera.focal_point = (0, 0, 0)
    plotter.camera.position = 1.95 * np.array(eye)
    plotter.camera.up = (0, 0, 1)
    plotter.camera.view_angle = 30
    plotter.reset_camera_clipping_range()
    plotter.enable_anti_aliasing("ssaa")
    plotter.screenshot(out)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
    # VTK may hang or crash when it takes down its window without a display.
    sys.stdout.flush()
    os._exit(0)
