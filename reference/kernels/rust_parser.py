"""Parses functions of the Rust sources: the subset of Rust of the kernels. Everything else is an error."""
import re

TOKEN = re.compile(r"""\s+ | //[^\n]* | \#\[[^\]]*\] | '\w+
    | (?P<number>0x[\da-fA-F_]+|\d[\d_]*(?:\.\d+)?)(?P<suffix>[iu](?:8|16|32|64|128|size))?
    | "[^"]*" | (?P<name>[A-Za-z_]\w*) | (?P<op><<=|>>=|\.\.=|::|->|=>|==|!=|<=|>=|&&|\|\||<<|>>|\.\.|[-+*/%&|^]=|[-+*/%&|^!<>=?.,;:(){}\[\]])""", re.X)
LEVELS = [["||"], ["&&"], ["==", "!=", "<", ">", "<=", ">="], ["|"], ["^"], ["&"], ["<<", ">>"], ["+", "-"], ["*", "/", "%"]]


class Parser:
    """Parses into tuples: the name of the method of `Run` that evaluates it, and its parts."""

    def __init__(self, text, start=0):
        self.tokens, self.at = [], 0
        depth = 0
        while start < len(text):
            m = TOKEN.match(text, start)
            if not m:
                raise SyntaxError(text[start:start + 40])
            start = m.end()
            if m.lastgroup:
                self.tokens.append(("number", m["number"], m["suffix"]) if m["number"] else (m.lastgroup, m[0]))
                depth += {"{": 1, "}": -1}.get(m[0], 0)
                if (m[0] == "}" and depth == 0) or (m[0] == ";" and depth == 0 and self.balanced()):
                    break
        self.tokens.append(("end", ""))

    def balanced(self):
        return sum({"[": 1, "(": 1, "]": -1, ")": -1}.get(t[1], 0) for t in self.tokens) == 0

    def peek(self, *texts): return self.tokens[self.at][1] in texts and self.tokens[self.at][0] != "number"

    def next(self):
        self.at += 1
        return self.tokens[self.at - 1]

    def take(self, *texts): return self.peek(*texts) and self.next()[1]

    def need(self, text):
        if not self.take(text):
            raise SyntaxError(f"{text!r} expected at {[t[1] for t in self.tokens[self.at:self.at + 8]]}")

    def list(self, end, item):
        items = []
        while not self.take(end):
            items.append(item())
            if not self.take(","):
                self.need(end)
                break
        return items

    def type(self):
        depth, text = 0, ""
        while depth or not self.peek(",", ";", "=", ")", "]", "}", "{", "|", ">", ":"):
            t = self.next()[1]
            depth += {"(": 1, "[": 1, "<": 1, ")": -1, "]": -1, ">": -1, ">>": -2}.get(t, 0)
            text += t
        return text

    def function(self):
        while not self.take("fn"):
            self.next()
        name, constants = self.next()[1], []
        if self.take("<"):
            constants = [p[0] for p in self.list(">", lambda: (self.take("const"), self.next()[1], self.take(":"), self.type())[1:2])]
        self.need("(")
        parameters = self.list(")", lambda: (self.pattern(), self.type() if self.take(":") else ""))
        result = self.type() if self.take("->") else ""
        return name, constants, parameters, result, self.block()

    def pattern(self):
        while self.take("&", "mut"):
            pass
        if self.peek("(", "["):
            return self.list({"(": ")", "[": "]"}[self.next()[1]], self.pattern)
        kind, text, *_ = self.next()
        if text == "Range" and self.take("{"):
            return self.list("}", self.pattern)
        return int(text, 0) if kind == "number" else text

    def block(self):
        self.need("{")
        functions, statements = {}, []
        while not self.take("}"):
            if self.peek("const") and self.tokens[self.at + 1][1] == "fn":
                f = self.function()
                functions[f[0]] = f
            elif self.take("let", "const"):
                pattern, type = self.pattern(), self.type() if self.take(":") else ""
                self.need("=")
                statements.append(("let", pattern, type, self.expression()))
                self.need(";")
            elif self.take(";"):
                pass
            else:
                # A statement that begins with a block ends with it.
                statements.append(self.primary() if self.peek("if", "for", "while", "loop", "match") else self.expression())
                if not self.peek("}"):
                    # A block that is not the last expression has no value.
                    if self.take(";") or statements[-1][0] in ("if", "for", "while", "loop", "match"):
                        statements.append(("unit",))
        return "block", functions, statements

    def expression(self, level=-2):
        if level == -2:
            left = self.expression(-1)
            op = self.take("=", "+=", "-=", "|=", "&=", "^=", "*=", ">>=", "<<=")
            return ("assign", left, op[:-1], self.expression()) if op else left
        if level == -1:
            left = self.expression(0) if not self.peek("..") else ("number", 0, None)
            op = self.take("..", "..=")
            return ("range", left, self.expression(0) if not self.peek("]") else ("unit",), op == "..=") if op else left
        if level == len(LEVELS):
            return self.unary()
        left = self.expression(level + 1)
        while op := self.take(*LEVELS[level]):
            right = self.expression(level + 1)
            left = ("logic" if op in ("&&", "||") else "binary", op, left, right)
        return left

    def unary(self):
        if op := self.take("-", "!"):
            return "negative", op, self.unary()
        if self.take("&", "*"):
            self.take("mut")
            return self.unary()
        e = self.postfix()
        while self.take("as"):
            e = ("cast", e, "::".join(self.path()[0]))
        return e

    def path(self):
        names, generics = [self.next()[1]], []
        while self.take("::"):
            if self.take("<"):
                generics = self.list(">", lambda: self.expression(6) if not self.peek("[") else self.type())
            else:
                names.append(self.next()[1])
        return names, generics

    def postfix(self):
        e = self.primary()
        while True:
            if self.take("("):
                e = ("call", e, self.list(")", self.expression))
            elif self.take("["):
                e = ("index", e, self.expression())
                self.need("]")
            elif self.take("?"):
                e = ("attempt", e)
            elif self.take("."):
                name = self.next()[1]
                if self.take("::"):
                    self.need("<")
                    self.list(">", self.type)
                e = ("method", e, name, self.list(")", self.expression)) if self.take("(") else ("field", e, name)
            else:
                return e

    def primary(self):
        kind, text, *rest = self.tokens[self.at]
        if kind == "number":
            self.next()
            return "number", float(text) if "." in text and "x" not in text else int(text.replace("_", ""), 0), rest[0]
        if self.take("("):
            items = self.list(")", self.expression)
            return items[0] if len(items) == 1 and self.tokens[self.at - 2][1] != "," else ("array", items)
        if self.take("["):
            if self.take("]"):
                return "array", []
            first = self.expression()
            if self.take(";"):
                count = self.expression()
                self.need("]")
                return "repeat", first, count
            return "array", [first] + (self.list("]", self.expression) if self.take(",") else (self.need("]") or []))
        if self.peek("{"):
            return self.block()
        if self.peek("|", "||", "move"):
            self.take("move")
            parameters = [] if self.take("||") else (self.need("|") or self.list("|", lambda: (self.pattern(), self.type() if self.take(":") else "")))
            if self.take("->"):
                self.type()
            return "closure", parameters, self.expression()
        if self.take("const"):
            return self.block()
        if self.take("if"):
            condition, then = self.expression(), self.block()
            return "if", condition, then, (self.primary() if self.peek("if") else self.block()) if self.take("else") else ("unit",)
        if self.take("match"):
            value = self.expression()
            self.need("{")
            return "match", value, self.list("}", lambda: (self.pattern(), self.need("=>"), self.expression())[::2])
        if self.take("for"):
            pattern = self.pattern()
            self.need("in")
            return "for", pattern, self.expression(), self.block()
        if self.take("while"):
            return "while", self.expression(), self.block()
        if self.take("loop"):
            return "while", ("true",), self.block()
        if self.take("return"):
            return "return", ("unit",) if self.peek(";", "}") else self.expression()
        if self.take("continue"):
            return ("continue",)
        if kind != "name":
            raise SyntaxError(f"{[t[1] for t in self.tokens[self.at:self.at + 8]]}")
        names, generics = self.path()
        if re.fullmatch("[A-Z][a-z]+", names[-1]) and self.take("{"):
            return "struct", self.list("}", lambda: (name := self.next()[1], self.expression() if self.take(":") else ("path", [name], [])))
        return "path", names, generics
