"""Facts about the mesher's kernels that its code relies on, for all inputs; ci/kernels proves them.

A fact is a function of `Kernels`: it draws inputs, evaluates functions of the Rust sources on them and yields what must hold. Its doc
comment is the sentence that is proven. That nothing overflows in these functions is part of every fact. Beside it are faults to plant in
the sources, each of which must make its proof fail.
"""
import z3
from rust import WIDTHS, Number, Run, Struct, known, limits, plain, term

OCTANT, BRICK, FACET = "bricks/src/octant.rs", "bricks/src/brick.rs", "bricks/src/facet.rs"
DILATE, TILE = "bricks/src/dilate.rs", "bricks/src/dilate/tile.rs"
DIGEST, LATTICE, REFINE = "bricks/src/digest.rs", "src/input/lattice.rs", "src/refine.rs"
RAYS, VERDICT, CHECK_SPLITS, CHECK_SIDES = "src/sides/rays.rs", "src/sides/verdict.rs", "src/check/splits.rs", "src/check/sides.rs"
FILES = [OCTANT, BRICK, DILATE, TILE, FACET, DIGEST, LATTICE, REFINE, RAYS, VERDICT, CHECK_SPLITS, CHECK_SIDES]

# What DEFINITION.md states, not what the sources do.
ROOT = 1 << 27
VERTEX = (-(1 << 27), 1 << 28)
AXES = range(3)
OCTANTS = [[i & 1 | i >> 2 & 2, i >> 1 & 1 | i >> 3 & 2, i >> 2 & 1 | i >> 4 & 2] for i in range(64)]  # positions in a brick, by bit
BIT_AT = {tuple(p): i for i, p in enumerate(OCTANTS)}

FACTS = []


def fact(file, *mutants):
    def register(f):
        f.file, f.mutants = file, [(file, *m) if len(m) == 2 else m for m in mutants]
        FACTS.append(f)
        return f
    return register


class Kernels:
    def __init__(self, sources): self.sources, self.given, self.checks, self.ranges, self.bounds, self.kept = sources, [], [], [], {}, []

    # Inputs

    def bits(self, type, below=None):
        x = z3.FreshConst(z3.BitVecSort(WIDTHS[type]))
        if below is not None:
            self.given.append(z3.ULT(x, below))
        return Number(type, x)

    def integer(self, type, low, high):
        """A term of unbounded integers, within bounds."""
        x = z3.FreshInt()
        self.given.append(z3.And(low <= x, x <= high))
        self.bounds[x.get_id()] = low, high
        self.kept.append(x)
        return Number(type, x)

    def signed(self, type, low, high):
        """The same as a bit-vector."""
        x = self.bits(type)
        self.given.append(z3.And(low <= x.x, x.x <= high))
        return x

    def float(self): return Number("f64", z3.FreshConst(z3.Float64()))
    def facet(self, draw): return Struct(v=[[draw("i32", *VERTEX) for _ in AXES] for _ in range(3)])

    # Evaluation

    def paths(self, name, *args, file=None, module=None, constants=(), replaced=None):
        """The conditions of all paths through a function, with the results."""
        choices, paths = [], []
        while True:
            run = Run(self.sources, replaced, choices)
            args_now = [a(run) if callable(a) else list(a) if isinstance(a, list) else a for a in args]
            result = run.call(name, args_now, file, module, constants)
            self.checks += run.checks
            self.ranges += run.ranges
            paths.append((z3.And(run.path), result))
            choices = run.choices[:run.made]
            while choices and not choices[-1]:
                choices.pop()
            if not choices:
                return paths
            choices[-1] = False

    def tiles(self, w, key, r, margin, side, zeros, replaced):
        """The tiles, by path, in which a brick was put and dilated."""
        choices = []
        while True:
            run = Run(self.sources, replaced, choices)
            tile = Struct(radius=usize(r), margin=usize(margin), side=usize(side), rows=list(zeros), spread=list(zeros), layers=u32(0), columns=u32(0), columns_at=[u32(0)] * 32)
            run.call("put", [tile, Struct(key=Number("u64", key), bits=w)], TILE)
            if plain(tile["layers"]):
                run.call("dilate_lanes", [tile], TILE)
            self.checks += run.checks
            yield z3.And(run.path), tile
            choices = run.choices[:run.made]
            while choices and not choices[-1]:
                choices.pop()
            if not choices:
                return
            choices[-1] = False

    def __call__(self, name, *args, **options):
        paths = self.paths(name, *args, **options)
        result = paths[-1][1]
        for condition, other in reversed(paths[:-1]):
            result = merged(condition, other, result)
        return result

    def option(self, name, *args, **options):
        """Whether the result is `Some`, and its value then."""
        paths = self.paths(name, *args, **options)
        found = [p for p in paths if p[1] is not None]
        result = found[-1][1]
        for condition, other in reversed(found[:-1]):
            result = merged(condition, other, result)
        return z3.Or([c for c, _ in found]), result


    def interval(self, x):
        """Bounds of a term of unbounded integers by interval arithmetic: those of products are hard for z3."""
        if x.get_id() not in self.bounds:
            kind, parts = x.decl().kind(), [self.interval(c) for c in x.children() if isinstance(c, z3.ArithRef)]
            if kind == z3.Z3_OP_ANUM:
                found = x.as_long(), x.as_long()
            elif kind == z3.Z3_OP_ADD:
                found = sum(p[0] for p in parts), sum(p[1] for p in parts)
            elif kind == z3.Z3_OP_SUB:
                found = parts[0][0] - sum(p[1] for p in parts[1:]), parts[0][1] - sum(p[0] for p in parts[1:])
            elif kind == z3.Z3_OP_MUL:
                found = parts[0]
                for p in parts[1:]:
                    ends = [a * b for a in found for b in p]
                    found = min(ends), max(ends)
            elif kind == z3.Z3_OP_POWER:
                bound = max(-parts[0][0], parts[0][1]) ** x.arg(1).as_long()
                found = -bound, bound
            elif kind == z3.Z3_OP_UMINUS:
                found = -parts[0][1], -parts[0][0]
            elif kind == z3.Z3_OP_IDIV:
                found = parts[0][0] // parts[1][0], parts[0][1] // parts[1][0]
            elif kind == z3.Z3_OP_ITE:
                test, (a, b) = x.arg(0), x.children()[1:]
                if test.children() and test.arg(0).eq(a) and test.arg(1).eq(b) and test.decl().kind() in (z3.Z3_OP_GE, z3.Z3_OP_LE):
                    each = max if test.decl().kind() == z3.Z3_OP_GE else min
                    found = each(parts[0][0], parts[1][0]), each(parts[0][1], parts[1][1])
                else:
                    found = min(p[0] for p in parts), max(p[1] for p in parts)
            else:
                raise NotImplementedError(x.decl())
            self.bounds[x.get_id()] = found
            self.kept.append(x)
        return self.bounds[x.get_id()]


    def largest(self, type="i128"): return max(abs(end) for _, _, x, high in self.ranges if high == limits(type)[1] for end in self.interval(x))

    def linear(self, goal):
        """A goal that implies this one, in linear arithmetic: products of unknowns become unknowns, within their intervals."""
        goal, products, seen, bounds = z3.simplify(goal, som=True), {}, set(), []
        stack = [goal]
        while stack:
            x = stack.pop()
            if x.get_id() in seen:
                continue
            seen.add(x.get_id())
            stack += x.children()
            if isinstance(x, z3.ArithRef) and x.decl().kind() in (z3.Z3_OP_MUL, z3.Z3_OP_POWER):
                factors = [c for c in x.children() if not z3.is_int_value(c)] if x.decl().kind() == z3.Z3_OP_MUL else [x]
                coefficient = [c for c in x.children() if z3.is_int_value(c)] if x.decl().kind() == z3.Z3_OP_MUL else []
                if len(factors) > 1 or x.decl().kind() == z3.Z3_OP_POWER:
                    key = tuple(sorted(f.get_id() for f in factors))
                    if key not in products:
                        products[key] = z3.FreshInt(), []
                        low, high = self.interval(z3.Product(factors) if len(factors) > 1 else x)
                        bounds.append(z3.And(low <= products[key][0], products[key][0] <= high))
                    products[key][1].append((x, coefficient[0] * products[key][0] if coefficient else products[key][0]))
        return z3.Implies(z3.And(bounds), z3.substitute(goal, *[pair for _, pairs in products.values() for pair in pairs])) if products else goal


def merged(c, a, b):
    if isinstance(a, list):
        return [merged(c, x, y) for x, y in zip(a, b, strict=True)]
    if isinstance(a, Struct):
        return Struct({k: merged(c, a[k], b[k]) for k in a})
    if isinstance(a, Number) or isinstance(b, Number):
        like = b if known(a) else a
        return Number(like.type, z3.If(c, term(a, like), term(b, like)))
    return z3.If(c, a, b)


# Terms of specifications


def bit(n, i): return z3.Extract(i, i, n.x if isinstance(n, Number) else n)
def has(n, i): return bit(n, i) == 1
def word(bits): return z3.Concat([b if isinstance(b, z3.BitVecRef) else z3.If(b, z3.BitVecVal(1, 1), z3.BitVecVal(0, 1)) for b in reversed(list(bits))])
def no(_): return z3.BitVecVal(0, 1)
def any_bit(bits): bits = list(bits); return z3.Or([b == 1 for b in bits]) if bits else z3.BoolVal(False)
def wide(n, width): return z3.ZeroExt(width - n.x.size(), n.x)
def union(w, sources): return word(any_bit(bit(w, j) for j in sources(i)) for i in range(64))
def u32(n): return Number("u32", n)
def usize(n): return Number("usize", n)
def i64(n): return Number("i64", n)
def code_of(k, l): return k.bits("u64", 1 << 3 * l)


def octant(k, levels):
    """Any octant of any level below `levels`."""
    l, code = k.bits("u32", levels), k.bits("u64")
    k.given.append(z3.ULT(code.x, z3.BitVecVal(1, 64) << 3 * z3.ZeroExt(32, l.x)))
    return l, code


def maximum(items): m = items[0]; return m if len(items) == 1 else (lambda r: z3.If(m >= r, m, r))(maximum(items[1:]))
def minimum(items): m = items[0]; return m if len(items) == 1 else (lambda r: z3.If(m <= r, m, r))(minimum(items[1:]))
