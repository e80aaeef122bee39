"""Writes small meshes with discretize's own writers, and their cells as x,y,z,edge.

    pip install discretize==0.12.0 && python discretize_meshes.py && tar --create --gzip --file discretize.tar.gz *.csv *.json *.msh
"""

import numpy as np
from discretize import TreeMesh


def write(name, mesh, point):
    mesh.refine_points([point], -1, padding_cells_by_level=[1, 1])
    mesh.write_UBC(f"{name}.msh")
    mesh.save(f"{name}.json")
    edges = mesh.h_gridded[:, 0]
    rows = np.column_stack([mesh.cell_centers - edges[:, None] / 2, edges])
    np.savetxt(f"{name}.csv", rows, fmt="%.17g", delimiter=",", header="x,y,z,edge", comments="")


write("cube", TreeMesh([np.full(16, 0.125)] * 3, origin=[-1, 2, 0.5], diagonal_balance=True), [-0.4, 2.3, 1.1])
write("flat", TreeMesh([np.full(n, 0.5) for n in (16, 8, 4)], origin=[0, 0, -1], diagonal_balance=True), [1, 1, 0])
# write_UBC rounds these edges to 0.016.
write("rounded", TreeMesh([np.full(16, 1 / 64)] * 3, origin=[0, 0, 0], diagonal_balance=True), [0.1, 0.1, 0.1])
