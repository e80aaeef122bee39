"""Prints where a Jenkinsfile is not valid Groovy; exit code 1 if it is not. Whether Jenkins knows its steps is not checked."""

import sys

import tree_sitter_groovy
from tree_sitter import Language, Parser

parser = Parser(Language(tree_sitter_groovy.language()))


def faults(node):
    if node.is_error or node.is_missing:
        yield node
    for child in node.children:
        yield from faults(child)


found = 0
for path in sys.argv[1:]:
    for node in faults(parser.parse(open(path, "rb").read()).root_node):
        print(f"{path}:{node.start_point.row + 1}: not valid Groovy")
        found += 1
sys.exit(found > 0)
