"""Sides by trimesh: one ray along x and, where its two directions differ, others; cast by embree.

Known weaknesses: a ray through an edge counts twice and through a vertex n times; embree computes in
float32, and on hard bodies does not always repeat itself. Without embreex it would need minutes for what
takes embree a second, so that counts as missing.
"""

import protocol

try:
    import embreex  # noqa: F401
    import trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector
except ImportError as error:
    protocol.missing(error)


def sides(points, facets):
    # Not merged and not repaired: the oracle is to see the soup that the mesher saw.
    vertices = facets.reshape(-1, 3)
    faces = [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(len(facets))]
    body = trimesh.Trimesh(vertices, faces, process=False, validate=False)
    return RayMeshIntersector(body).contains_points(points)


if __name__ == "__main__":
    protocol.run("trimesh", trimesh.__version__, sides)
