"""Compares the counts of `harness geometry` with those of trimesh and pymeshlab on the geometries in this repository.

Run with: python -m unittest discover harness/oracles
"""

import json
import pathlib
import tempfile
import unittest

import numpy as np

try:
    import trimesh
except ImportError:
    trimesh = None

try:
    import pymeshlab
except ImportError:
    pymeshlab = None

from built import ROOT, needs, run


def diagnose(path):
    """The diagnosis, and the counts of its findings by kind."""
    with tempfile.TemporaryDirectory() as directory:
        out = pathlib.Path(directory) / "geometry.json"
        code, _, error = run("harness", "geometry", path, "--json", out)
        if code not in (0, 1):
            raise AssertionError(f"{path}: exit code {code}: {error}")
        diagnosis = json.loads(out.read_text())
    return diagnosis, {finding["kind"]: finding for finding in diagnosis["findings"]}


def load(path):
    """The mesh with equal f32 vertices merged and facets with a repeated vertex removed, and all its facets."""
    soup = trimesh.load_mesh(path, process=False)
    facets = np.asarray(soup.vertices)[soup.faces].astype(np.float32)
    vertices, corners = np.unique(facets.reshape(-1, 3), axis=0, return_inverse=True)
    corners = corners.reshape(-1, 3)
    repeats = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    return trimesh.Trimesh(vertices, corners[~repeats], process=False, validate=False), len(facets), repeats.sum()


def components(mesh):
    """Number of sets of facets that trimesh connects, across edges that have exactly two facets."""
    parents = list(range(len(mesh.faces)))

    def find(facet):
        while parents[facet] != facet:
            parents[facet] = parents[parents[facet]]
            facet = parents[facet]
        return facet

    for a, b in mesh.face_adjacency.tolist():
        parents[find(a)] = find(b)
    return sum(find(facet) == facet for facet in range(len(parents)))


@unittest.skipIf(trimesh is None, "trimesh is not installed")
@needs("harness")
class GeometryTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        paths = sorted(ROOT.glob("geometries/*.stl")) + sorted(ROOT.glob("geometries/fetched/*.stl"))
        cls.cases = [(path.name, *diagnose(path), *load(path)) for path in paths]
        assert cls.cases, "no geometries"

    def test_counts_agree(self):
        for name, diagnosis, findings, mesh, facets, repeats in self.cases:
            with self.subTest(name):
                count = {kind: finding["count"] for kind, finding in findings.items()}
                uses = np.unique(mesh.edges_unique_inverse, return_counts=True)[1]
                self.assertEqual(diagnosis["facets"], facets)
                self.assertEqual(diagnosis["edges"]["open"], (uses == 1).sum())
                self.assertEqual(count["non_manifold_odd"], ((uses > 2) & (uses % 2 == 1)).sum())
                self.assertEqual(diagnosis["edges"]["even"], ((uses > 2) & (uses % 2 == 0)).sum())
                self.assertEqual(count["duplicates"], (~mesh.unique_faces()).sum())
                self.assertEqual(diagnosis["facets"] - diagnosis["shells"]["facets"], repeats)

    def test_watertight_means_two_facets_at_every_edge(self):
        for name, diagnosis, _, mesh, _, _ in self.cases:
            with self.subTest(name):
                other = sum(diagnosis["edges"][kind] for kind in ("open", "odd", "even"))
                self.assertEqual(other == 0, mesh.is_watertight)

    def test_winding_agrees_where_every_edge_has_two_facets(self):
        for name, _, findings, mesh, _, _ in self.cases:
            with self.subTest(name):
                if mesh.is_watertight:
                    self.assertEqual(findings["winding"]["count"] == 0, mesh.is_winding_consistent)

    def test_shells_agree_where_no_edge_has_more_than_two_facets(self):
        for name, diagnosis, _, mesh, _, _ in self.cases:
            with self.subTest(name):
                if not diagnosis["edges"]["odd"] + diagnosis["edges"]["even"]:
                    self.assertEqual(diagnosis["shells"]["count"], components(mesh))

    @unittest.skipIf(pymeshlab is None, "pymeshlab is not installed")
    def test_counts_agree_with_pymeshlab(self):
        """pymeshlab drops facets with a repeated vertex. It counts an edge with three facets three times, so only whether
        there are edges with more than two facets is compared."""
        for path in sorted(ROOT.glob("geometries/*.stl")) + sorted(ROOT.glob("geometries/fetched/*.stl")):
            with self.subTest(path.name):
                _, diagnosis, _, _, facets, repeats = next(c for c in self.cases if c[0] == path.name)
                meshes = pymeshlab.MeshSet()
                meshes.load_new_mesh(str(path))
                measures = meshes.get_topological_measures()
                self.assertEqual(facets - repeats, measures["faces_number"])
                self.assertEqual(diagnosis["edges"]["open"], measures["boundary_edges"])
                self.assertEqual(diagnosis["shells"]["count"], measures["connected_components_number"])
                odd_and_even = diagnosis["edges"]["odd"] + diagnosis["edges"]["even"]
                self.assertEqual(odd_and_even > 0, measures["non_two_manifold_edges"] > 0)


if __name__ == "__main__":
    unittest.main()
