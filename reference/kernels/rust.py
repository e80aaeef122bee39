"""Reads functions of the Rust sources and evaluates them, on integers or on terms of z3.

The subset of Rust is that of the kernels: integers, arrays, tuples, closures, loops whose bounds are known, early returns. Everything
else is an error. Integers of z3's bit-vectors have Rust's meaning; a signed one may also be an unbounded integer of z3, where products
of 64 bits would be hard for bit-vectors. Every addition, subtraction and product of either kind, every shift and, of unbounded integers,
every conversion leaves a condition in `Run.checks`: that nothing overflows. Sums and differences of unbounded integers that may wrap, and
conversions from i128, are anything where they do. An `if` on a term is evaluated in both ways, path by path. Of a function with a body
for AVX-512, the portable one is read.
"""
import re
from pathlib import Path

import z3
from rust_parser import Parser

MESHER = Path(__file__).resolve().parents[2] / "mesher"
WIDTHS = {f"{sign}{width}": width for sign in "iu" for width in (8, 16, 32, 64, 128)} | {"usize": 64}
ALIASES = {"Level": "u32", "Vector": "[i64;3]"}
WITH_AVX512 = re.compile(r"^with_avx512! \{\n(.*?\bfn [^{]*)\{\n.*?^    \} else (\{\n.*?^    \}\n)\}", re.M | re.S)


class Sources:
    """The text of some files of the mesher, perhaps with one text replaced by another."""

    def __init__(self, files, change=None):
        self.texts = {f: WITH_AVX512.sub(r"\1\2", (MESHER / f).read_text().split("\nmod tests {")[0]) for f in files}
        if change:
            file, old, new = change
            if self.texts[file].count(old) != 1:
                raise ValueError(f"{file} has {self.texts[file].count(old)} times {old!r}")
            self.texts[file] = self.texts[file].replace(old, new)
        self.parsed, self.constants = {}, {}

    def find(self, kind, name, file, module=None):
        """The file that defines a function or constant, and where: this file if it does, else one of the module's name, else the only one."""
        pattern = re.compile(rf"\b{kind} {name}\b")
        places = {f: [m.start() for m in pattern.finditer(text)] for f, text in self.texts.items()}
        # A function comes before a method of its name, which is indented.
        indented = lambda f: lambda at: self.texts[f][self.texts[f].rfind("\n", 0, at) + 1] == " "
        found = {f: min(of, key=indented(f)) for f, of in places.items() if of}
        named = [f for f in found if Path(f).stem == module]
        if file in found and not (named and module):
            return file, found[file]
        for f in named or found:
            if named or len(found) == 1:
                return f, found[f]
        return None if not found else (_ for _ in ()).throw(NameError(f"{name} is in {sorted(found)}"))

    def function(self, name, file, module=None):
        place = self.find("fn", name, file, module)
        if place and place not in self.parsed:
            self.parsed[place] = Parser(self.texts[place[0]], place[1]).function()
        return place and (place[0], self.parsed[place])

    def constant(self, name, file, module=None):
        place = self.find("(?:const|static)", name, file, module)
        if place and place not in self.constants:
            p = Parser(self.texts[place[0]], place[1])
            p.next(), p.next(), p.need(":")
            type = p.type()
            p.need("=")
            self.constants[place] = coerced(Run(self).evaluate(p.expression(), Scope(place[0])), type)
        return place and self.constants[place]


    def fragment(self, before, file):
        """The value of the expression after some text."""
        text = self.texts[file]
        p = Parser("{" + text[text.index(before) + len(before):].split(";")[0].split(")")[0] + "}")
        return Run(self).evaluate(p.block(), Scope(file))


class Scope(dict):
    def __init__(self, file, parent=None, functions=None): self.file, self.parent, self.functions = file, parent, functions or {}

    def holding(self, name):
        scope = self
        while scope is not None and name not in scope:
            scope = scope.parent
        return scope

    def nested(self, name):
        scope = self
        while scope is not None and name not in scope.functions:
            scope = scope.parent
        return scope


class Number:
    """A number of a type: an int (for f64, a float), or a term."""

    def __init__(self, type, x): self.type, self.x = type, x
    def __repr__(self): return f"{self.x}: {self.type}"
    def __index__(self): return self.x
    @property
    def is_known(self): return isinstance(self.x, (int, float))
    @property
    def is_unbounded(self): return isinstance(self.x, z3.ArithRef)


class Struct(dict):
    pass


class Range(list):
    def __init__(self, start, end, items): self.start, self.end = start, end; super().__init__(items)


class View:
    """A part of an array, through which it can be changed."""

    def __init__(self, items, start, end): self.items, self.start, self.end = items, start, end
    def __len__(self): return self.end - self.start
    def __getitem__(self, i): return self.items[self.start + i]
    def __setitem__(self, i, value): self.items[self.start + i] = value
    def __iter__(self): return (Place(self, i) for i in range(len(self)))


class Place:
    """An element of a view. Its value is asked for where its name is used."""

    def __init__(self, view, i): self.view, self.i = view, i


class FromFn:
    def __init__(self, f): self.f = f


class Leave(Exception):
    pass


def limits(type):
    bits = WIDTHS[type]
    return (-1 << bits - 1, (1 << bits - 1) - 1) if type[0] == "i" else (0, (1 << bits) - 1)


def wrapped(type, x):
    low, high = limits(type)
    return (x - low) % (high - low + 1) + low


def coerced(value, type):
    """A value where a type is known: literals get that type."""
    type = ALIASES.get(type, type).removeprefix("&")
    if type in WIDTHS and isinstance(value, int) and not isinstance(value, bool):
        return Number(type, value)
    if type[:1] == "[" and isinstance(value, (list, FromFn)):
        inner, _, count = type[1:-1].rpartition(";")
        items = [value.f(i) for i in range(int(count))] if isinstance(value, FromFn) else value
        return [coerced(v, inner) for v in items] if count else items
    return value


def term(n, like):
    """A number as a term of the kind of another number."""
    x = n.x if isinstance(n, Number) else n
    if isinstance(like.x, z3.FPRef):
        return z3.FPVal(x, z3.Float64()) if isinstance(x, (int, float)) else x
    if isinstance(x, z3.ExprRef):
        return x
    return z3.IntVal(x) if like.is_unbounded else z3.BitVecVal(x, WIDTHS[like.type])


def known(n): return not isinstance(n, Number) or n.is_known
def plain(n): return n.x if isinstance(n, Number) else n
def either(c, a, b): return (a if c else b) if isinstance(c, bool) else z3.If(c, a, b)


class Run:
    """One evaluation along one path."""

    def __init__(self, sources, replaced=None, choices=()):
        self.sources, self.replaced = sources, replaced or {}
        self.choices, self.made, self.path, self.checks, self.ranges = list(choices), 0, [], [], []

    def check(self, condition): self.checks.append(z3.Implies(z3.And(self.path), condition))

    def check_range(self, x, type):
        low, high = limits(type)
        self.ranges.append((z3.And(self.path), low, x, high))

    def truth(self, c):
        if not isinstance(c, z3.ExprRef):
            return c
        c = z3.simplify(c)
        if z3.is_true(c) or z3.is_false(c):
            return z3.is_true(c)
        if self.made == len(self.choices):
            self.choices.append(True)
        chosen = self.choices[self.made]
        self.made += 1
        self.path.append(c if chosen else z3.Not(c))
        return chosen

    # Functions

    def call(self, name, args, file=None, module=None, constants=()):
        if name in self.replaced:
            return self.replaced[name](self, *args)
        found = self.sources.function(name, file, module)
        if not found:
            raise NameError(name)
        return self.apply(found[1], args, Scope(found[0]), constants)

    def apply(self, function, args, parent, constants=()):
        _, names, parameters, type, body = function
        scope = Scope(parent.file, parent)
        scope.update({n: plain(c) for n, c in zip(names, constants)})
        for (pattern, t), a in zip(parameters, args, strict=True):
            if t.startswith("&mut"):
                scope[pattern] = a
            else:
                self.bind(pattern, coerced(a, t), scope)
        try:
            value = self.evaluate(body, scope)
        except Leave as leave:
            if leave.args[0] != "return":
                raise
            value = leave.args[1]
        return coerced(value, type)

    def bind(self, pattern, value, scope):
        if isinstance(pattern, list):
            for p, v in zip(pattern, [value.start, value.end] if isinstance(value, Range) else value, strict=True):
                self.bind(p, v, scope)
        else:
            # Arrays are values.
            scope[pattern] = list(value) if type(value) is list else value

    # Expressions

    def evaluate(self, e, scope): return getattr(self, "on_" + e[0])(scope, *e[1:])
    def on_unit(self, scope): return None
    def on_true(self, scope): return True
    def on_number(self, scope, x, type): return Number(type, x) if type else Number("f64", x) if isinstance(x, float) else x
    def on_array(self, scope, items): return [self.evaluate(i, scope) for i in items]
    def on_repeat(self, scope, item, count): return [self.evaluate(item, scope) for _ in range(plain(self.evaluate(count, scope)))]
    def on_field(self, scope, e, name): v = self.evaluate(e, scope); return getattr(v, name) if isinstance(v, Range) else v[int(name)] if isinstance(v, list) else v[name]
    def on_struct(self, scope, fields): return Struct({name: self.evaluate(e, scope) for name, e in fields})
    def on_closure(self, scope, parameters, body): return lambda *args: self.apply(("", [], parameters, "", body), args, scope)
    def on_return(self, scope, e): raise Leave("return", self.evaluate(e, scope))
    def on_continue(self, scope): raise Leave("continue")
    def on_if(self, scope, c, a, b): return self.evaluate(a if self.truth(self.evaluate(c, scope)) else b, scope)

    def on_block(self, scope, functions, statements):
        inner, value = Scope(scope.file, scope, functions), None
        for s in statements:
            value = self.evaluate(s, inner)
        return value

    def on_let(self, scope, pattern, type, e): self.bind(pattern, coerced(self.evaluate(e, scope), type), scope)

    def on_while(self, scope, c, body):
        while self.truth(self.evaluate(c, scope)):
            self.evaluate(body, scope)

    def on_for(self, scope, pattern, e, body):
        for item in self.evaluate(e, scope):
            inner = Scope(scope.file, scope)
            self.bind(pattern, item, inner)
            try:
                self.evaluate(body, inner)
            except Leave as leave:
                if leave.args[0] != "continue":
                    raise

    def on_match(self, scope, value, arms):
        value = self.evaluate(value, scope)
        def fits(p, v):
            if isinstance(p, list):
                return all(fits(q, w) for q, w in zip(p, v))
            return p == "_" or self.truth(self.binary("==", v, p))
        return next(self.evaluate(e, scope) for p, e in arms if fits(p, value))

    def on_range(self, scope, a, b, closed):
        a, b = self.evaluate(a, scope), self.evaluate(b, scope)
        type = next((n.type for n in (a, b) if isinstance(n, Number)), None)
        if b is None:
            return Range(a, None, [])
        # A range to loop over is short; of others only the ends are asked for.
        is_short = known(a) and known(b) and plain(b) - plain(a) <= 4096
        return Range(a, b, [Number(type, i) if type else i for i in range(plain(a), plain(b) + closed)] if is_short else [])

    def on_attempt(self, scope, e):
        v = self.evaluate(e, scope)
        if v is None:
            raise Leave("return", None)
        return v

    def on_assign(self, scope, place, op, e):
        value = self.evaluate(e, scope)
        if place[0] == "array":
            for p, v in zip(place[1], value, strict=True):
                self.store(scope, p, v)
        else:
            self.store(scope, place, self.binary(op, self.evaluate(place, scope), value) if op else value)

    def store(self, scope, place, value):
        if place[0] == "path":
            holder = scope.holding(place[1][0])
            old = holder[place[1][0]]
            if isinstance(old, Place):
                old.view[old.i] = value
            else:
                holder[place[1][0]] = value
        elif place[0] == "field":
            self.evaluate(place[1], scope)[place[2]] = value
        elif place[0] == "index":
            self.evaluate(place[1], scope)[plain(self.evaluate(place[2], scope))] = value
        else:
            raise SyntaxError(place[0])

    def on_path(self, scope, names, generics):
        name, module = names[-1], names[-2] if len(names) > 1 else None
        if module in WIDTHS:
            low, high = limits(module)
            return {"MAX": Number(module, high), "MIN": Number(module, low), "BITS": Number("u32", WIDTHS[module]), "from": lambda n: self.cast(n, module)}[name]
        if name in ("true", "false", "None"):
            return {"true": True, "false": False, "None": None}[name]
        if name == "Some":
            return lambda v: v
        if name == "Self":
            return lambda *args: Struct({str(i): a for i, a in enumerate(args)})
        if name == "from_fn":
            return FromFn
        if names == ["std", "mem", "take"]:
            return lambda v: v
        holder = scope.holding(name)
        if holder is not None:
            value = holder[name]
            return value.view[value.i] if isinstance(value, Place) else value
        nested = scope.nested(name)
        if nested is not None:
            return lambda *args: self.apply(nested.functions[name], args, nested)
        if name.isupper():
            return self.replaced[name] if name in self.replaced else self.sources.constant(name, scope.file, module)
        constants = [self.evaluate(g, scope) for g in generics if isinstance(g, tuple)]
        return lambda *args: self.call(name, args, scope.file, module, constants)

    def on_call(self, scope, f, args): return self.evaluate(f, scope)(*[self.evaluate(a, scope) for a in args])

    def on_index(self, scope, e, i):
        items, i = self.evaluate(e, scope), self.evaluate(i, scope)
        if isinstance(i, Range):
            return View(items, plain(i.start), len(items) if i.end is None else plain(i.end))
        return items(i) if callable(items) else items[plain(i)] if known(i) else self.chosen(items, i)

    def chosen(self, items, i):
        """The item at an index that is a term; beyond the array is an error."""
        self.check(self.both(self.binary(">=", i, 0), self.binary("<", i, len(items))))
        if isinstance(items[0], list):
            return [self.chosen([row[k] for row in items], i) for k in range(len(items[0]))]
        like = next(n for n in items if isinstance(n, Number))
        def tree(low, high):
            if high - low == 1:
                return term(items[low], Number(like.type, z3.BitVecVal(0, WIDTHS[like.type])))
            middle = (low + high) // 2
            return z3.If(self.binary("<", i, middle), tree(low, middle), tree(middle, high))
        return Number(like.type, tree(0, len(items)))

    def on_logic(self, scope, op, a, b):
        a = self.evaluate(a, scope)
        if isinstance(a, bool):
            return self.evaluate(b, scope) if a == (op == "&&") else a
        self.path.append(a if op == "&&" else z3.Not(a))
        b = self.evaluate(b, scope)
        self.path.pop()
        return z3.And(a, b) if op == "&&" else z3.Or(a, b)

    def both(self, a, b): return a and b if isinstance(a, bool) else z3.And(a, b)
    def on_binary(self, scope, op, a, b): return self.binary(op, self.evaluate(a, scope), self.evaluate(b, scope))

    def on_negative(self, scope, op, e):
        v = self.evaluate(e, scope)
        if op == "-":
            return self.binary("-", 0, v) if not isinstance(plain(v), (float, z3.FPRef)) else Number("f64", -v.x)
        return (not v) if isinstance(v, bool) else z3.Not(v) if isinstance(v, z3.BoolRef) else self.binary("^", v, -1 if v.type[0] == "i" else limits(v.type)[1])

    def on_cast(self, scope, e, type): return self.cast(self.evaluate(e, scope), ALIASES.get(type, type))

    def cast(self, v, type):
        if isinstance(v, bool):
            v = int(v)
        if isinstance(v, z3.BoolRef):
            return Number(type, z3.If(v, z3.BitVecVal(1, WIDTHS[type]), z3.BitVecVal(0, WIDTHS[type])))
        if type == "f64":
            return Number(type, float(plain(v)))
        if known(v):
            return Number(type, wrapped(type, plain(v)))
        if v.is_unbounded and v.type[0] == "i" and type == f"u{WIDTHS[v.type]}":
            return Number(type, z3.If(v.x < 0, v.x + (1 << WIDTHS[type]), v.x))
        if v.is_unbounded and (v.type, type) == ("i128", "i64"):
            return self.unless_beyond(v.x, type)
        if v.is_unbounded:
            self.check_range(v.x, type)
            return Number(type, v.x)
        more = WIDTHS[type] - WIDTHS[v.type]
        return Number(type, z3.Extract(WIDTHS[type] - 1, 0, v.x) if more < 0 else (z3.SignExt if v.type[0] == "i" else z3.ZeroExt)(more, v.x))

    def binary(self, op, a, b):
        if isinstance(a, (bool, z3.BoolRef)) and isinstance(b, (bool, z3.BoolRef)):
            if isinstance(a, bool) and isinstance(b, bool):
                return {"&": a and b, "|": a or b, "^": a != b, "==": a == b, "!=": a != b}[op]
            return {"&": lambda: z3.And(a, b), "|": lambda: z3.Or(a, b), "^": lambda: z3.Xor(a, b), "==": lambda: a == b, "!=": lambda: a != b}[op]()
        if isinstance(a, list):
            equal = [self.binary("==", x, y) for x, y in zip(a, b, strict=True)]
            return {"==": z3.And(equal), "!=": z3.Not(z3.And(equal))}[op]
        is_shift = op in ("<<", ">>")
        type = next((n.type for n in ((a,) if is_shift else (a, b)) if isinstance(n, Number)), None)
        if op in ("==", "!=", "<", ">", "<=", ">="):
            return self.compared(op, a, b)
        if known(a) and known(b):
            x, y = plain(a), plain(b)
            if type == "f64":
                return Number(type, {"+": x + y, "-": x - y, "*": x * y}[op])
            if is_shift and type and not 0 <= y < WIDTHS[type]:
                raise OverflowError(f"{a} {op} {b}")
            exact = {"+": lambda: x + y, "-": lambda: x - y, "*": lambda: x * y, "/": lambda: x // y, "%": lambda: x % y, "&": lambda: x & y, "|": lambda: x | y,
                     "^": lambda: x ^ y, "<<": lambda: x << y, ">>": lambda: x >> y}[op]()
            if op in "/%" and min(x, y) < 0:
                raise NotImplementedError("division of negative integers")
            if type is None:
                return exact
            if op in "+-*" and wrapped(type, exact) != exact:
                raise OverflowError(f"{a} {op} {b}")
            return Number(type, wrapped(type, exact))
        if is_shift:
            return self.shifted(op, a if isinstance(a, Number) else Number("i32", a), b)
        like = a if not known(a) else b
        x, y = term(a, like), term(b, like)
        if isinstance(x, z3.FPRef):
            return Number("f64", {"+": z3.fpAdd, "-": z3.fpSub, "*": z3.fpMul}[op](z3.RNE(), x, y))
        if like.is_unbounded:
            value = {"+": lambda: x + y, "-": lambda: x - y, "*": lambda: x * y}[op]()
            self.check_range(value, type)
            return Number(type, value)
        signed = type[0] == "i"
        if op == "+":
            self.check(z3.BVAddNoOverflow(x, y, signed))
            if signed:
                self.check(z3.BVAddNoUnderflow(x, y))
        elif op == "-":
            self.check(z3.BVSubNoUnderflow(x, y, signed))
            if signed:
                self.check(z3.BVSubNoOverflow(x, y))
        elif op == "*":
            self.check(z3.BVMulNoOverflow(x, y, signed))
            if signed:
                self.check(z3.BVMulNoUnderflow(x, y))
        return Number(type, {"+": lambda: x + y, "-": lambda: x - y, "*": lambda: x * y, "&": lambda: x & y, "|": lambda: x | y, "^": lambda: x ^ y}[op]())

    def shifted(self, op, a, by):
        bits = WIDTHS[a.type]
        if a.is_unbounded:
            power = 1 << plain(by)
            value = a.x * power if op == "<<" else a.x / power
            self.check_range(value, a.type)
            return Number(a.type, value)
        x, n = term(a, Number(a.type, z3.BitVecVal(0, bits))), plain(by)
        if not isinstance(n, int):
            self.check(z3.ULT(n, bits) if by.type[0] == "u" else z3.And(n >= 0, n < bits))
            n = self.cast(by, f"u{bits}").x
        elif not 0 <= n < bits:
            raise OverflowError(f"shift by {n}")
        return Number(a.type, x << n if op == "<<" else z3.LShR(x, n) if a.type[0] == "u" else x >> n)

    def compared(self, op, a, b):
        if known(a) and known(b):
            x, y = plain(a), plain(b)
            return {"==": x == y, "!=": x != y, "<": x < y, ">": x > y, "<=": x <= y, ">=": x >= y}[op]
        like = a if not known(a) else b
        x, y = term(a, like), term(b, like)
        if op in ("==", "!="):
            equal = z3.fpEQ(x, y) if isinstance(x, z3.FPRef) else x == y
            return equal if op == "==" else z3.Not(equal)
        if isinstance(x, z3.BitVecRef) and like.type[0] == "u":
            return {"<": z3.ULT, ">": z3.UGT, "<=": z3.ULE, ">=": z3.UGE}[op](x, y)
        return {"<": lambda: x < y, ">": lambda: x > y, "<=": lambda: x <= y, ">=": lambda: x >= y}[op]()

    # Methods

    def on_method(self, scope, e, name, args):
        v, args = self.evaluate(e, scope), [self.evaluate(a, scope) for a in args]
        if isinstance(v, Struct):
            return self.call(name, [v, *args], scope.file)
        if v is None:
            return None
        kind = "list_" if isinstance(v, (list, View)) else "bool_" if isinstance(v, (bool, z3.BoolRef)) else "number_"
        return getattr(self, kind + name)(v, *args)

    def list_iter(self, v): return v
    def list_map(self, v, f): return [f(x) for x in v]
    def list_filter(self, v, f): return [x for x in v if self.truth(f(x))]
    def list_enumerate(self, v): return [[i, x] for i, x in enumerate(v)]
    def list_find(self, v, f): return next((x for x in v if self.truth(f(x))), None)

    def list_max_by_key(self, v, f): return self.list_fold(v[1:], v[0], lambda best, x: x if self.truth(self.binary(">=", f(x), f(best))) else best)
    def list_expect(self, v): return v

    def list_fold(self, v, value, f):
        for x in v:
            value = f(value, x)
        return value

    def list_sum(self, v): return self.list_fold(v[1:], v[0], lambda a, b: self.binary("+", a, b))

    def list_any(self, v, f):
        each = [f(x) for x in v]
        return any(each) if all(isinstance(x, bool) for x in each) else z3.Or(each)

    def list_into_iter(self, v): return v
    def list_iter_mut(self, v): return v
    def list_clone(self, v): return v
    def list_len(self, v): return Number("usize", len(v))
    def list_zip(self, v, w): return [[x, y] for x, y in zip(v, w, strict=True)]

    def list_copy_from_slice(self, v, w):
        for i in range(len(w)):
            v[i] = w[i]

    def list_chunks(self, v, n): return [v[i:i + plain(n)] for i in range(0, len(v), plain(n))]

    def list_all(self, v, f):
        each = [f(x) for x in v]
        return all(each) if all(isinstance(x, bool) for x in each) else z3.And(each)

    def bool_then_some(self, c, v): return v if self.truth(c) else None

    def pick(self, a, b, op):
        """`a` where `a op b`, else `b`."""
        if known(a) and known(b):
            return a if self.compared(op, a, b) else b
        like = a if not known(a) else b
        return Number(like.type, z3.If(self.compared(op, a, b), term(a, like), term(b, like)))

    def number_max(self, a, b): return self.pick(a, b, ">=")
    def number_min(self, a, b): return self.pick(a, b, "<=")
    def number_clamp(self, a, low, high): return self.pick(self.pick(a, low, ">="), high, "<=")

    def number_abs(self, a):
        if a.type == "f64":
            return Number("f64", abs(a.x) if a.is_known else z3.fpAbs(a.x))
        return self.pick(a, self.binary("-", 0, a), ">=")

    def number_signum(self, a):
        if known(a):
            return Number(a.type, (a.x > 0) - (a.x < 0))
        return Number(a.type, z3.If(a.x > 0, term(1, a), z3.If(a.x < 0, term(-1, a), term(0, a))))

    # Options are values or None.
    def number_filter(self, v, f): return v if self.truth(f(v)) else None
    def number_checked_add(self, a, b): return self.checked("+", a, b)
    def number_checked_sub(self, a, b): return self.checked("-", a, b)
    def number_checked_add_signed(self, a, b): return self.checked("-", a, -plain(b)) if plain(b) < 0 else self.checked("+", a, plain(b))

    def checked(self, op, a, b):
        """Of unsigned numbers."""
        b = coerced(b, a.type)
        if known(a) and known(b):
            exact = a.x + b.x if op == "+" else a.x - b.x
            return Number(a.type, exact) if wrapped(a.type, exact) == exact else None
        x, y = term(a, a if known(b) else b), term(b, b if known(a) else a)
        fits = z3.BVAddNoOverflow(x, y, False) if op == "+" else z3.UGE(x, y)
        return Number(a.type, x + y if op == "+" else x - y) if self.truth(fits) else None

    def number_round_ties_even(self, a): return Number("f64", float(round(a.x)) if a.is_known else z3.fpRoundToIntegral(z3.RNE(), a.x))

    def unless_beyond(self, x, type):
        low, high = limits(type)
        return Number(type, z3.If(z3.And(low <= x, x <= high), x, z3.FreshInt()))

    def wrapping(self, a, b, f):
        if a.is_known and known(b):
            return Number(a.type, wrapped(a.type, f(a.x, plain(b))))
        like = b if a.is_known else a
        value = f(term(a, like), term(b, like))
        return self.unless_beyond(value, a.type) if like.is_unbounded else Number(a.type, value)

    def number_wrapping_neg(self, a): return self.wrapping(Number(a.type, 0), a, lambda x, y: x - y)
    def number_wrapping_add(self, a, b): return self.wrapping(a, b, lambda x, y: x + y)
    def number_wrapping_sub(self, a, b): return self.wrapping(a, b, lambda x, y: x - y)
    def number_wrapping_mul(self, a, b): return self.wrapping(a, b, lambda x, y: x * y)

    def number_rotate_left(self, a, n):
        bits, n = WIDTHS[a.type], plain(n)
        return Number(a.type, wrapped(a.type, a.x << n | a.x >> bits - n) if a.is_known else z3.RotateLeft(a.x, n))

    def number_trailing_zeros(self, a):
        bits = WIDTHS[a.type]
        return Number("u32", (a.x & -a.x).bit_length() - 1 if a.x else bits) if a.is_known else self.zeros_before(a, range(bits))

    def number_leading_zeros(self, a):
        bits = WIDTHS[a.type]
        return Number("u32", bits - (a.x % (1 << bits)).bit_length()) if a.is_known else self.zeros_before(a, reversed(range(bits)))

    def zeros_before(self, a, order):
        """The number of bits before the first that is set, in an order of all bits of a term."""
        value = z3.BitVecVal(WIDTHS[a.type], 32)
        for n, i in reversed(list(enumerate(order))):
            value = z3.If(z3.Extract(i, i, a.x) == 1, z3.BitVecVal(n, 32), value)
        return Number("u32", value)
