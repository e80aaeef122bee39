"""Sides by open3d: the majority of the parities of embree's hits along several rays.

Known weaknesses: it computes in float32, and its answer is defined for watertight bodies only. By default it casts
a single ray; this oracle requests an odd number of rays.
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
    protocol.run(sides)
