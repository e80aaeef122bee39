"""Sides by VTK, through pyvista: random rays from each point until a vote is clear.

Known weaknesses: hits nearer to each other than a tolerance count once, so that sheets closer than that
are seen as one; it expects a closed surface.
"""

import numpy as np
import protocol

try:
    import pyvista
except (ImportError, OSError) as error:
    protocol.missing(error)

# As a share of the body's bounding box. VTK's own 0.001 merges the two sheets of a thin wing.
TOLERANCE = 1e-6


def sides(points, facets):
    # Vertices are merged where they are equal to the bit, which is all that VTK's cell locator wants.
    vertices, index = np.unique(facets.reshape(-1, 3), axis=0, return_inverse=True)
    faces = np.column_stack([np.full(len(facets), 3), index.reshape(-1, 3)])
    body = pyvista.PolyData(vertices, faces.ravel())
    # The other method, signed distance, takes facets that are turned the wrong way for the inside.
    chosen = pyvista.PolyData(points).select_interior_points(
        body, method="cell_locator", check_surface=False, locator_tolerance=TOLERANCE
    )
    return chosen.point_data["selected_points"].astype(bool)


if __name__ == "__main__":
    protocol.run("pyvista", pyvista.__version__, sides)
