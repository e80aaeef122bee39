"""Sides by trimesh: rays along x in both directions, and further rays if the two disagree, all cast by embree.

Known weaknesses: a ray through an edge hits two facets, and a ray through a vertex hits all facets there. embree
computes in float32, and its answers for difficult bodies are not always reproducible. Without embreex, trimesh takes
minutes instead of a second, so a missing embreex is reported as a missing package.
"""

import protocol

try:
    import embreex  # noqa: F401
    import trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector
except ImportError as error:
    protocol.missing(error)


def sides(points, facets):
    # Neither merged nor repaired: the oracle must see the same facets as the mesher.
    vertices = facets.reshape(-1, 3)
    faces = [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(len(facets))]
    body = trimesh.Trimesh(vertices, faces, process=False, validate=False)
    return RayMeshIntersector(body).contains_points(points)


if __name__ == "__main__":
    protocol.run(sides)
