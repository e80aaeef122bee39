"""Sides by open3d: parity of embree's hits along several rays, by majority.

Known weaknesses: it computes in float32; it promises an answer for watertight bodies only; and casts a
single ray unless told otherwise, hence an odd number of samples.
"""

import numpy as np
import protocol

try:
    import open3d
except (ImportError, OSError) as error:
    protocol.missing(error)

SAMPLES = 5


def sides(points, facets):
    scene = open3d.t.geometry.RaycastingScene()
    vertices = np.ascontiguousarray(facets.reshape(-1, 3), np.float32)
    faces = np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3)
    scene.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(faces))
    queries = open3d.core.Tensor(np.ascontiguousarray(points, np.float32))
    return scene.compute_occupancy(queries, nsamples=SAMPLES).numpy() > 0.5


if __name__ == "__main__":
    protocol.run("open3d", open3d.__version__, sides)
