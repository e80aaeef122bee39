"""Leaf sets on disk, as sections 8 and 11 of the definition have them, for corrupt.py and agree.py."""
import json
import struct
from array import array

OUTSIDE, INSIDE, CROSSING = range(3)


def key(w): return w >> 7
def level(w): return w >> 2 & 31
def side(w): return w & 3
def word(k, l, s): return k << 7 | l << 2 | s
def volume(l): return 1 << 3 * (19 - l)


class LeafSet:
    def __init__(self, directory):
        self.name, self.directory = directory.name, directory
        self.manifest = json.loads((directory / "mesh.json").read_text())
        self.parts = []
        for part in self.manifest["parts"]:
            data = (directory / part["file"]).read_bytes()
            words = array("Q")
            words.frombytes(data[10 + struct.unpack("<H", data[8:10])[0]:])
            self.parts.append(list(words))

    def copy(self):
        other = object.__new__(LeafSet)
        other.name, other.directory, other.manifest, other.parts = self.name, self.directory, dict(self.manifest), [list(part) for part in self.parts]
        for field in "leaves_by_level", "leaves_by_side", "parts":
            other.manifest[field] = json.loads(json.dumps(self.manifest[field]))
        return other

    @property
    def words(self): return self.parts[0]

    def count(self):
        """The manifest's counts become those of the leaves."""
        words = [w for part in self.parts for w in part]
        m = self.manifest
        m["leaves"] = len(words)
        m["leaves_by_level"] = [sum(level(w) == l for w in words) for l in range(20)]
        m["leaves_by_side"] = {name: sum(side(w) == s for w in words) for s, name in enumerate(("outside", "inside", "crossing"))}
        m["parts"] = [{"file": f"leaves-{i:05}.npy", "leaves": len(part)} for i, part in enumerate(self.parts)]

    def write(self, directory):
        directory.mkdir(parents=True)
        (directory / "mesh.json").write_text(json.dumps(self.manifest))
        for i, part in enumerate(self.parts):
            header = "{'descr': '<u8', 'fortran_order': False, 'shape': (%d,), }" % len(part)
            header += " " * (-(len(header) + 11) % 64) + "\n"
            (directory / f"leaves-{i:05}.npy").write_bytes(
                b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + array("Q", part).tobytes())
