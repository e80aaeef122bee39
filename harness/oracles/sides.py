"""The oracles, which find on which side of a body points lie: python sides.py trimesh|open3d|pyvista, by the protocol of protocol.py.

Each is a function that imports its package and returns the function `sides` of the protocol.
"""

import sys

import numpy as np
import protocol


def trimesh():
    """Rays along x in both directions, and further rays if the two disagree, all cast by embree.

    Known weaknesses: a ray through an edge hits two facets, and a ray through a vertex hits all facets there. embree
    computes in float32, and its answers for difficult bodies are not always reproducible. Without embreex, trimesh takes
    minutes instead of a second, so a missing embreex is reported as a missing package.
    """
    import embreex  # noqa: F401
    from trimesh import Trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    def sides(points, facets):
        # Neither merged nor repaired: the oracle must see the same facets as the mesher.
        vertices = facets.reshape(-1, 3)
        faces = [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(len(facets))]
        body = Trimesh(vertices, faces, process=False, validate=False)
        return RayMeshIntersector(body).contains_points(points)

    return sides


def open3d():
    """The majority of the parities of embree's hits along several rays.

    Known weaknesses: it computes in float32, and its answer is defined for watertight bodies only. By default it casts
    a single ray; this oracle requests an odd number of rays.
    """
    import open3d

    samples = 5

    def sides(points, facets):
        scene = open3d.t.geometry.RaycastingScene()
        vertices = np.ascontiguousarray(facets.reshape(-1, 3), np.float32)
        faces = np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3)
        scene.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(faces))
        queries = open3d.core.Tensor(np.ascontiguousarray(points, np.float32))
        return scene.compute_occupancy(queries, nsamples=samples).numpy() > 0.5

    return sides


def pyvista():
    """VTK, through pyvista: random rays from each point until one side has a clear majority.

    Known weaknesses: hits closer to each other than a tolerance count once, so two sheets closer than that appear as
    one. It expects a closed surface.
    """
    import pyvista

    # Relative to the size of the bounding box. VTK's default of 0.001 merges the two sheets of a thin wing.
    tolerance = 1e-6

    def sides(points, facets):
        # Merging bit-equal vertices suffices for VTK's cell locator.
        vertices, index = np.unique(facets.reshape(-1, 3), axis=0, return_inverse=True)
        faces = np.column_stack([np.full(len(facets), 3), index.reshape(-1, 3)])
        body = pyvista.PolyData(vertices, faces.ravel())
        # The other method, signed distance, gives wrong sides at facets that are wound inward.
        chosen = pyvista.PolyData(points).select_interior_points(
            body, method="cell_locator", check_surface=False, locator_tolerance=tolerance
        )
        return chosen.point_data["selected_points"].astype(bool)

    return sides


ORACLES = {"trimesh": trimesh, "open3d": open3d, "pyvista": pyvista}

if __name__ == "__main__":
    try:
        oracle = ORACLES[sys.argv[1]]()
    except (ImportError, OSError) as error:
        protocol.missing(error)
    protocol.run(oracle)
