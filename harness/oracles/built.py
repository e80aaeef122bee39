"""The programs that tests run on what they write, a directory for a class of such tests, and meshes that other programs wrote."""

import atexit
import functools
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAMS = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug"
# Levels of the lattice of leaf words.
EDGE_BITS = 19


def needs(*programs):
    """Skips a class of tests unless these programs are built."""
    missing = [name for name in programs if not (PROGRAMS / name).is_file()]
    return unittest.skipIf(missing, f"{' and '.join(missing)} not built in {PROGRAMS}: run cargo test --workspace --no-run")


def run(program, *arguments):
    """Exit code, standard output and standard error of one of the programs."""
    environment = os.environ | {"HARNESS_PYTHON": sys.executable}
    run = subprocess.run([PROGRAMS / program, *arguments], capture_output=True, text=True, env=environment)
    return run.returncode, run.stdout, run.stderr


def decode(words):
    """Corners (in lattice units), levels and sides of leaf words (morton57 << 7 | level << 2 | side)."""
    morton = words >> np.uint64(7)
    corners = np.zeros((len(words), 3), np.int64)
    for bit in range(EDGE_BITS):
        for axis in range(3):
            corners[:, axis] |= ((morton >> np.uint64(3 * bit + axis)) & np.uint64(1)).astype(np.int64) << bit
    return corners, (words >> np.uint64(2) & np.uint64(31)).astype(int), (words & np.uint64(3)).astype(int)


class InDirectory(unittest.TestCase):
    """Tests of files in the directory `at`."""

    @classmethod
    def setUpClass(cls):
        place = tempfile.TemporaryDirectory()
        cls.addClassCleanup(place.cleanup)
        cls.at = pathlib.Path(place.name)


@functools.cache
def samples():
    """A directory with the samples of harness/contract, in which its archives are unpacked."""
    place = tempfile.TemporaryDirectory()
    atexit.register(place.cleanup)
    at = pathlib.Path(place.name) / "samples"
    shutil.copytree(ROOT / "harness/contract/tests/samples", at)
    for packed in at.glob("*.tar.gz"):
        # Debian 12's Python knows no filters of members yet.
        shutil.unpack_archive(packed, at)
    return at
