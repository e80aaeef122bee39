"""The programs that tests run on what they write, and a directory for a class of such tests."""

import os
import pathlib
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAMS = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug"


def needs(*programs):
    """Skips a class of tests unless these programs are built."""
    missing = [name for name in programs if not (PROGRAMS / name).is_file()]
    return unittest.skipIf(missing, f"{' and '.join(missing)} not built in {PROGRAMS}: run cargo test --workspace --no-run")


class InDirectory(unittest.TestCase):
    """Tests of files in the directory `at`."""

    @classmethod
    def setUpClass(cls):
        place = tempfile.TemporaryDirectory()
        cls.addClassCleanup(place.cleanup)
        cls.at = pathlib.Path(place.name)
