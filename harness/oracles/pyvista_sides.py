"""Sides by VTK, through pyvista: random rays from each point until one side has a clear majority.

Known weaknesses: hits closer to each other than a tolerance count once, so two sheets closer than that appear as
one. It expects a closed surface.
"""

import numpy as np
import protocol

try:
    import pyvista
except (ImportError, OSError) as error:
    protocol.missing(error)

# Relative to the size of the bounding box. VTK's default of 0.001 merges the two sheets of a thin wing.
TOLERANCE = 1e-6


def sides(points, facets):
    # Merging bit-equal vertices suffices for VTK's cell locator.
    vertices, index = np.unique(facets.reshape(-1, 3), axis=0, return_inverse=True)
    faces = np.column_stack([np.full(len(facets), 3), index.reshape(-1, 3)])
    body = pyvista.PolyData(vertices, faces.ravel())
    # The other method, signed distance, gives wrong sides at facets that are wound inward.
    chosen = pyvista.PolyData(points).select_interior_points(
        body, method="cell_locator", check_surface=False, locator_tolerance=TOLERANCE
    )
    return chosen.point_data["selected_points"].astype(bool)


if __name__ == "__main__":
    protocol.run(sides)
