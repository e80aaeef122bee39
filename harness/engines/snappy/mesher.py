"""Meshes a case with OpenFOAM's blockMesh and snappyHexMesh (castellated mesh only), which the harness reads as it is.
../peers.md states the settings and why they are fair."""

import argparse
import json
import math
import os
import re
import resource
import subprocess
import time
import tomllib
from pathlib import Path

import numpy as np

LEVEL_BLOCKS_MAX = 6  # at most 64 blocks along an edge of the root

HEADER = "FoamFile {{ version 2.0; format ascii; class dictionary; object {}; }}\n"
CONTROL = "application none; startTime 0; endTime 1; deltaT 1; writeInterval 1; writeFormat binary; writePrecision 17;\n"
BLOCKS = """vertices ({corners});
blocks (hex (0 1 2 3 4 5 6 7) ({n} {n} {n}) simpleGrading (1 1 1));
boundary (far {{ type patch; faces ((0 3 2 1) (4 5 6 7) (0 1 5 4) (2 3 7 6) (1 2 6 5) (3 0 4 7)); }});
"""
# A surface that is a face zone divides no region, so both sides of the body are kept. Without a cell zone, snappyHexMesh fails
# where every face of the zone is free-standing.
SNAPPY = """castellatedMesh true; snap false; addLayers false;
geometry {{ body.stl {{ type triSurfaceMesh; name body; }} }}
castellatedMeshControls
{{
    maxLocalCells 2000000000; maxGlobalCells 2000000000; minRefinementCells 0; maxLoadUnbalance 0.1;
    nCellsBetweenLevels {layers}; resolveFeatureAngle 30; allowFreeStandingZoneFaces true;
    features (); refinementSurfaces {{ body {{ level ({level} {level}); faceZone body; cellZone body; cellZoneInside inside; }} }} refinementRegions {{}}
    locationInMesh ({inside});
}}
// Required, although nothing is snapped and no layers are added.
snapControls {{ nSmoothPatch 3; tolerance 2; nSolveIter 30; nRelaxIter 5; }}
addLayersControls
{{
    relativeSizes true; layers {{}} expansionRatio 1; finalLayerThickness 0.3; minThickness 0.1; nGrow 0; featureAngle 60;
    nRelaxIter 3; nSmoothSurfaceNormals 1; nSmoothNormals 3; nSmoothThickness 10; maxFaceThicknessRatio 0.5;
    maxThicknessToMedialRatio 0.3; minMedianAxisAngle 90; nBufferCellsNoExtrude 0; nLayerIter 50;
}}
meshQualityControls
{{
    maxNonOrtho 65; maxBoundarySkewness 20; maxInternalSkewness 4; maxConcave 80; minVol 1e-30; minTetQuality -1e30; minArea -1;
    minTwist 0.02; minDeterminant 0.001; minFaceWeight 0.05; minVolRatio 0.01; minTriangleTwist -1; nSmoothScale 4;
    errorReduction 0.75;
}}
mergeTolerance 1e-6;
"""
DECOMPOSE = "numberOfSubdomains {ranks}; method simple;\nsimpleCoeffs {{ n ({ranks} 1 1); delta 0.001; }}\n"


def level_for(edge, spacing):
    """The level of a spacing in a root with this edge."""
    return next(level for level in range(20) if edge / 2**level <= spacing)


def bounds(stl):
    """The minimum and maximum corner of the body of a binary STL file."""
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    corners = np.frombuffer(stl.read_bytes()[84:], facet)["corners"].reshape(-1, 3).astype(float)
    return corners.min(0), corners.max(0)


def write_case(case, stl, place, ranks):
    """Writes OpenFOAM's input. The level of the blocks is the first whose blocks are at most half as long as the
    shortest edge of the body's bounding box, because snappyHexMesh refines only blocks whose surface it meets."""
    (place / "system").mkdir(parents=True)
    (place / "constant/triSurface").mkdir(parents=True)
    (place / "constant/triSurface/body.stl").symlink_to(stl.resolve())
    origin, edge = np.array(case["root"]["origin"], float), case["root"]["edge"]
    surface = level_for(edge, case["spacing_min"])
    low, high = bounds(stl)
    shortest = max(min(high - low), edge / 2**LEVEL_BLOCKS_MAX)
    blocks = min(level_for(edge, shortest / 2), surface, LEVEL_BLOCKS_MAX)
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    corners = " ".join("({!r} {!r} {!r})".format(*map(float, origin + edge * np.array([x, y, z]))) for z in (0, 1) for x, y in square)
    # Any point off the faces of the finest cells; both sides are kept.
    inside = " ".join(repr(float(c)) for c in origin + edge * (1 + math.sqrt(2)) / 2 ** (surface + 3))
    files = {
        "controlDict": CONTROL, "fvSchemes": "", "fvSolution": "", "decomposeParDict": DECOMPOSE.format(ranks=ranks),
        "blockMeshDict": BLOCKS.format(corners=corners, n=2**blocks),
        "snappyHexMeshDict": SNAPPY.format(layers=case.get("layer_cells_min", 4), level=surface - blocks, inside=inside)}
    for name, text in files.items():
        sections = "ddtSchemes {} gradSchemes {} divSchemes {} laplacianSchemes {} interpolationSchemes {} snGradSchemes {}\n"
        (place / "system" / name).write_text(HEADER.format(name) + (sections if name == "fvSchemes" else text))


def run(place, *command):
    """Runs an OpenFOAM program and returns its name, its wall time and its CPU time."""
    cpu_s = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    wall, cpu = time.perf_counter(), cpu_s()
    done = subprocess.run(command, cwd=place, env={"WM_PROJECT_DIR": "/usr/share/openfoam"} | os.environ | {"PWD": str(place)},
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{command[0]} ended with code {done.returncode}:\n{done.stdout[-4000:]}")
    return command[3 if command[0] == "mpirun" else 0], time.perf_counter() - wall, cpu_s() - cpu


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("case", type=Path, help="case file with a binary STL file, a [root] table and keep = \"all\"")
    parser.add_argument("out", type=Path, help="the OpenFOAM case to make")
    parser.add_argument("--json", type=Path, metavar="FILE", help="run report")
    parser.add_argument("--ranks", type=int, default=1, help="number of MPI ranks")
    options = parser.parse_args()
    case, ranks, place = tomllib.loads(options.case.read_text()), options.ranks, options.out
    write_case(case, options.case.parent / case["geometry"], place, ranks)
    phases = [run(place, "blockMesh")]
    if ranks == 1:
        phases.append(run(place, "snappyHexMesh", "-overwrite"))
    else:
        phases.append(run(place, "decomposePar"))
        phases.append(run(place, "mpirun", "-n", str(ranks), "snappyHexMesh", "-overwrite", "-parallel"))
        run(place, "reconstructParMesh", "-constant")
    if options.json:
        head = (place / "constant/polyMesh/owner").read_bytes()[:4096]
        phases = [{"name": name, "time_wall_s": [wall], "time_cpu_s": [cpu]} for name, wall, cpu in phases]
        options.json.write_text(json.dumps({
            "cells": int(re.search(rb"nCells:\s*(\d+)", head)[1]), "ranks": ranks,
            "time_wall_s": sum(phase["time_wall_s"][0] for phase in phases), "phases": phases}))


if __name__ == "__main__":
    main()
