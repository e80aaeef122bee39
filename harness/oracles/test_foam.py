"""OpenFOAM accepts the meshes of `harness export`, and solves on them. Run with: python -m unittest discover harness/oracles

Needs target/debug/{harness,mesher,reference}, which `cargo test --workspace` builds, and OpenFOAM (ci/peers snappy)."""

import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import tempfile
import time
import unittest

import numpy as np

from built import PROGRAMS, ROOT, needs

TEMPLATE = ROOT / "harness/solvers/openfoam/case"
ENVIRONMENT = {
    "WM_PROJECT_DIR": "/usr/share/openfoam",
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
} | os.environ
# Every word of `checkMesh` about topology, for all of which it writes OK.
TOPOLOGY = [
    "Boundary definition", "Cell to face addressing", "Point usage", "Upper triangular ordering", "Face vertices",
    "Topological cell zip-up check", "Face-face connectivity",
]


def call(directory, *command):
    """The output of a command, which must succeed."""
    done = subprocess.run([str(c) for c in command], cwd=directory, env=ENVIRONMENT, capture_output=True, text=True)
    if done.returncode != 0:
        raise AssertionError(f"{command} failed in {directory}:\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
    return done.stdout


@needs("harness", "reference")
@unittest.skipUnless(shutil.which("checkMesh"), "OpenFOAM is not installed: run ci/peers snappy")
class FoamTest(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.at = pathlib.Path(temporary.name)
        shutil.copytree(TEMPLATE, self.at / "case")

    def export(self, *options):
        call(self.at, PROGRAMS / "harness", "export", self.at / "mesh", "case/constant/polyMesh", *options)

    def mesh(self, text):
        (self.at / "case.toml").write_text(text)
        call(self.at, PROGRAMS / "reference", "case.toml", "--out", "mesh")

    def decompose(self, ranks):
        dictionary = (TEMPLATE / "system/decomposeParDict").read_text().replace("RANKS", str(ranks))
        (self.at / "case/system/decomposeParDict").write_text(dictionary)
        call(self.at / "case", "decomposePar")

    def check_mesh(self, ranks=1):
        """The output of checkMesh, which must find all topology in order."""
        parallel = ["mpirun", "-n", ranks] if ranks > 1 else []
        options = ["-allTopology"] + ["-parallel"] * (ranks > 1)
        output = call(self.at / "case", *parallel, "checkMesh", *options)
        for test in TOPOLOGY:
            self.assertIn(f"{test} OK.", output)
        return output

    def test_meshes_of_random_cases_are_in_order(self):
        """Bodies and spacings vary, with both kinds of crossing leaves and all sides that can be kept; boxes are finer or coarser
        than the surface and overlap."""
        choice = random.Random(1)
        cases = [(keep, crossing) for keep in ("all", "outside", "inside") for crossing in ("true", "false")]
        for keep, crossing in 2 * cases:
            bodies = [("sphere", 320), ("torus", 400), ("boxes_overlapping", 200), ("uav", 2000)]
            # No cell lies inside the thin parts of the aircraft.
            body, facets = choice.choice(bodies[:3] if keep == "inside" else bodies)
            boxes = ""
            for _ in range(choice.randrange(3)):
                low = [choice.uniform(-1, 0.5) for _ in range(3)]
                high = [c + choice.uniform(0.1, 0.8) for c in low]
                boxes += f"[[box]]\nmin = {low}\nmax = {high}\nspacing = {choice.uniform(0.05, 0.3)}\n"
            text = f'keep = "{keep}"\nkeep_crossing = {crossing}\nspacing_min = {choice.uniform(0.03, 0.1)}\n'
            text += f"layer_cells_min = {choice.randrange(1, 4)}\nroot_scale = 3.0\n{boxes}"
            text += f'[generator]\nshape = "{body}"\nfacets = {facets}\n'
            with self.subTest(case=text):
                shutil.rmtree(self.at / "mesh", ignore_errors=True)
                shutil.rmtree(self.at / "case/constant/polyMesh", ignore_errors=True)
                self.mesh(text)
                self.export()
                output = self.check_mesh()
                self.assertIn("\nMesh OK.", output)
                levels = (self.at / "case/constant/polyMesh/cellLevel").read_bytes()
                cells = re.search(rb"\n(\d+)\n\(", levels)[1].decode()
                self.assertRegex(output, rf"\n    cells: +{cells}\n")

    def test_trees_without_balance_are_in_order(self):
        """Neighbours differ by any number of levels, and half of the octants are missing. Their cells are too skew for the checks
        of the geometry, whose result does not count."""
        for seed in range(4):
            choice, words = random.Random(seed), []

            def refine(corner, level):
                if level < 5 and choice.random() < 0.55 or level == 0:
                    half = 1 << (18 - level)
                    for digit in range(8):
                        refine([c + half * (digit >> a & 1) for a, c in enumerate(corner)], level + 1)
                elif choice.random() < 0.6:
                    morton = sum((corner[a] >> bit & 1) << (3 * bit + a) for bit in range(19) for a in range(3))
                    words.append(morton << 7 | level << 2)

            refine([0, 0, 0], 0)
            np.save(self.at / "words.npy", np.array(words, "<u8"))
            for name in ("mesh", "case/constant/polyMesh"):
                shutil.rmtree(self.at / name, ignore_errors=True)
            call(self.at, PROGRAMS / "harness", "import", "words.npy", "--out", "mesh")
            self.export()
            output = call_any(self.at / "case", "checkMesh", "-allTopology")
            for test in TOPOLOGY:
                self.assertIn(f"{test} OK.", output)

    def test_a_decomposed_mesh_is_in_order_and_is_solved_like_the_whole(self):
        sphere = (ROOT / "geometries/sphere-small.toml").read_text()
        self.mesh("keep_crossing = false\n" + sphere)
        self.export("--case", self.at / "case.toml")
        self.decompose(3)
        self.assertIn("\nMesh OK.", self.check_mesh(ranks=3))
        solver = [("laplacianFoam", "T"), ("potentialFoam", "Phi")]
        for program, name in solver:
            shutil.rmtree(self.at / "case/0", ignore_errors=True)
            shutil.copytree(TEMPLATE.parent / program, self.at / "case/0")
            call(self.at / "case", "decomposePar", "-fields")
            outputs = [
                call(self.at / "case", program),
                call(self.at / "case", "mpirun", "-n", 3, program, "-parallel"),
            ]
            residual = rf"Solving for {name}, Initial residual = ([-+.e\d]+)"
            serial, parallel = ([float(r) for r in re.findall(residual, output)] for output in outputs)
            self.assertEqual(len(serial), 6)
            np.testing.assert_allclose(serial[:4], parallel[:4], rtol=1e-2)
            # The explicit correction converges, which it does only if geometry and interpolation are right.
            self.assertLess(serial[-1], 1e-4)


class RunCase(unittest.TestCase):
    """The script `run`, with the programs of the tests."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.at = pathlib.Path(temporary.name)
        (self.at / "target").mkdir()
        (self.at / "target/release").symlink_to(PROGRAMS)
        (self.at / "duct.stl").write_text(duct())
        self.case = (
            'geometry = "duct.stl"\nspacing_min = 0.25\nkeep = "inside"\nkeep_crossing = false\nseeds = [[0, 0, 0]]\n'
            "[root]\norigin = [-2, -2, -2]\nedge = 4\n"
        )

    def start(self, *arguments, **pipes):
        bin = {"PATH": f"{self.at}/bin:{os.environ['PATH']}"}
        environment = ENVIRONMENT | {"CARGO_TARGET_DIR": str(self.at / "target")} | bin
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True} | pipes
        # A shell ignores for ever what was ignored when it began, as in jobs in the background.
        heed = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
        return subprocess.Popen([TEMPLATE.parent / "run", *arguments], cwd=self.at, env=environment, preexec_fn=heed, **pipes)

    def run_with(self, *arguments):
        process = self.start(*arguments)
        output, error = process.communicate()
        return process.returncode, output, error

    def refused(self, expected, *arguments):
        code, _, error = self.run_with(*arguments)
        self.assertEqual(code, 2, error)
        self.assertIn(expected, error)
        self.assertFalse((self.at / "out").exists())


@needs("harness", "mesher")
@unittest.skipUnless(shutil.which("potentialFoam"), "OpenFOAM is not installed: run ci/peers snappy")
class RunTest(RunCase):
    def test_a_flow_needs_an_inlet_and_an_outlet(self):
        """The root cuts the duct at yMin and yMax, and the template's inlet xMin has no face."""
        (self.at / "duct.toml").write_text(self.case)
        self.refused("choose an inlet and an outlet", "duct.toml", "-", "out")
        self.refused("choose two patches", "duct.toml", "-", "out", "--inlet", "yMin", "--outlet", "yMin")
        code, _, error = self.run_with("duct.toml", "-", "out", "--inlet", "yMin", "--outlet", "yMax")
        self.assertEqual(code, 0, error)
        self.assertIn("the flow reaches the root's boundary", error)
        velocity = values(self.at / "out/case/0/U", "vector", 3)
        np.testing.assert_allclose(velocity, np.broadcast_to([0, 1, 0], velocity.shape), atol=1e-6)

    def test_the_fields_of_a_result_are_those_that_were_solved_for(self):
        """A field of zeros that the solver only reads would pass for a pressure or a temperature."""
        (self.at / "duct.toml").write_text(self.case)
        flow = ["--inlet", "yMin", "--outlet", "yMax"]
        code, _, error = self.run_with("duct.toml", "-", "flow", *flow)
        self.assertEqual(code, 0, error)
        self.assertEqual({path.name for path in (self.at / "flow/case/0").iterdir()}, {"U", "Phi"})
        # The gradient of the potential is minus the velocity, and cells have an edge of 0.25 and more.
        potential = values(self.at / "flow/case/0/Phi", "scalar", 1)
        self.assertGreater(np.ptp(potential), 3)
        code, _, error = self.run_with("duct.toml", "-", "heat", "--solver", "laplacianFoam")
        self.assertEqual(code, 0, error)
        self.assertEqual({path.name for path in (self.at / "heat/case/0").iterdir()}, {"T"})
        self.assertGreater(np.ptp(values(self.at / "heat/case/1/T", "scalar", 1)), 0.1)

    def test_the_fields_of_a_result_on_ranks_are_joined(self):
        """A viewer shows the fields of the case, not those of its processors."""
        (self.at / "duct.toml").write_text(self.case)
        code, _, error = self.run_with("duct.toml", "-", "joined", "--inlet", "yMin", "--outlet", "yMax", "--ranks", "2")
        self.assertEqual(code, 0, error)
        self.assertGreater(np.ptp(values(self.at / "joined/case/0/Phi", "scalar", 1)), 3)


@needs("harness", "mesher")
class StandInTest(RunCase):
    """Other programs in the place of OpenFOAM's."""

    FLOW = ("duct.toml", "-", "out", "--inlet", "yMin", "--outlet", "yMax")
    # Writes a field as potentialFoam does.
    SOLVES = """while [ "$1" != -case ]; do shift; done; echo 'internalField   nonuniform List<scalar> 1(x)' >"$2/0/Phi\""""

    def setUp(self):
        super().setUp()
        (self.at / "bin").mkdir()
        (self.at / "duct.toml").write_text(self.case)
        self.program("checkMesh", "echo Mesh OK.")
        self.program("potentialFoam", "echo End")

    def program(self, name, text):
        (self.at / "bin" / name).write_text(f"#!/bin/sh\n{text}\n")
        (self.at / "bin" / name).chmod(0o755)

    def test_crossing_cells_and_the_spacing_of_a_case_are_refused(self):
        (self.at / "duct.toml").write_text(self.case.replace("false", "true"))
        self.refused("set keep_crossing = false", "duct.toml", "-", "out")
        self.refused("give - in place of 4", "duct.toml", "4", "out")

    def test_a_geometry_that_is_none_is_named_and_can_be_corrected(self):
        (self.at / "page.stl").write_text("<html></html>\n")
        self.refused("page.stl: is neither a binary STL nor a text STL", "page.stl", "1", "out")

    def test_a_solver_that_writes_nothing_has_not_solved(self):
        code, _, error = self.run_with(*self.FLOW)
        self.assertEqual(code, 1, error)
        self.assertIn("wrote no 0/Phi", error)

    def test_a_solver_that_does_not_converge_has_not_solved(self):
        residual = "GAMG:  Solving for Phi, Initial residual = 1, Final residual = {}, No Iterations {}"
        good, slow, wrong = residual.format("8e-10", 9), residual.format(0.37, 1000), residual.format("-nan", 2)
        logs = ((f"{good}\nContinuity error = 1e-9", 0), (slow, 1), (f"{slow}\n{good}", 1), (wrong, 1), (f"{good}\nContinuity error = nan", 1))
        for log, expected in logs:
            self.program("potentialFoam", f"echo '{log}'\n{self.SOLVES}")
            shutil.rmtree(self.at / "out", ignore_errors=True)
            code, _, error = self.run_with(*self.FLOW)
            self.assertEqual(code, expected, log + error)
            self.assertEqual("did not converge" in error, expected == 1, error)

    def test_a_mesh_in_order_is_so_whoever_reads_the_output(self):
        reads, writes = os.pipe()
        self.program("checkMesh", f"cat {self.at}/closed; echo Mesh OK.")
        os.mkfifo(self.at / "closed")
        process = self.start(*self.FLOW, stdout=writes)
        os.close(writes)
        # checkMesh runs while there is still a reader, and ends when there is none.
        with open(self.at / "closed", "w"):
            os.close(reads)
        _, error = process.communicate()
        self.assertNotIn("found a fault", error)

    def test_any_name_of_a_geometry_is_one_of_its_case(self):
        for name in ('q"x.stl', "b\\t.stl", "n\n.stl", "a&'b.stl"):
            shutil.copy(self.at / "duct.stl", self.at / name)
            shutil.rmtree(self.at / "out", ignore_errors=True)
            code, _, error = self.run_with(name, "0.5", "out", "--accept-leaks")
            self.assertIn("wrote no 0/Phi", error)

    def test_a_signal_ends_the_program_that_is_running(self):
        """A program in place of checkMesh waits, so that the signal always arrives while it runs."""
        self.program("checkMesh", f"echo $$ >{self.at}/pid.part\nmv {self.at}/pid.part {self.at}/pid\nexec sleep 60")
        for number, code in ((signal.SIGTERM, 143), (signal.SIGINT, 130)):
            patches = ["--inlet", "yMin", "--outlet", "yMax"]
            process = self.start("duct.toml", "-", f"out{code}", *patches)
            while not (self.at / "pid").exists():
                self.assertIsNone(process.poll())
                time.sleep(0.01)
            process.send_signal(number)
            _, error = process.communicate(timeout=30)
            self.assertEqual(process.returncode, code, error)
            with self.assertRaises(ProcessLookupError):
                os.kill(int((self.at / "pid").read_text()), 0)
            (self.at / "pid").unlink()


def values(path, kind, items):
    """The internal field of a binary field."""
    data = path.read_bytes()
    count = re.search(rb"internalField +nonuniform List<" + kind.encode() + rb"> *\n(\d+)\n\(", data)
    return np.frombuffer(data, "<f8", items * int(count[1]), count.end()).reshape(-1, items)


def duct():
    """A duct along y with a square section of edge 2, open at y = -3 and y = 3."""
    section = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    facets = []
    for (x0, z0), (x1, z1) in zip(section, section[1:] + section[:1]):
        a, b, c, d = (x0, -3, z0), (x1, -3, z1), (x1, 3, z1), (x0, 3, z0)
        facets += [(a, b, c), (a, c, d)]
    vertices = lambda facet: "".join(f"vertex {x} {y} {z}\n" for x, y, z in facet)
    text = "".join(f"facet normal 0 0 0\nouter loop\n{vertices(f)}endloop\nendfacet\n" for f in facets)
    return f"solid duct\n{text}endsolid duct\n"


def call_any(directory, *command):
    """The output of a command, which may fail."""
    done = subprocess.run([str(c) for c in command], cwd=directory, env=ENVIRONMENT, capture_output=True, text=True)
    return done.stdout


if __name__ == "__main__":
    unittest.main()
