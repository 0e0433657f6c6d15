"""Mutants as cargo-mutants lists them -> one source text that holds them all, each behind a switch.

A mutant is an edit of a range of bytes. Operators and guards become `(if crate::mutation::active(7) {(mutated)} else {(original)})`; a
function's replaced value becomes an early return; a deleted match arm gets a guard that fails. Edits may lie inside each other: both
copies of an operand then hold the inner switch. Where the language allows no call (constants, patterns, array lengths), inside
macros, and where a field is left out, no switch can stand: such mutants are skipped, with the reason.
"""

import dataclasses

import tree_sitter
import tree_sitter_rust

PARSER = tree_sitter.Parser(tree_sitter.Language(tree_sitter_rust.language()))
CONSTANT = {"const_item", "static_item", "enum_variant", "const_block", "const_parameter", "attribute_item", "macro_definition"}


class Skipped(Exception):
    """Why a mutant has no switch."""


@dataclasses.dataclass
class Edit:
    number: int
    kind: str  # "replace", "arm" or "return"
    start: int
    end: int
    # Of "replace": the mutated text is the source of `left`, then `middle`, then the source of `right`.
    left: tuple = (0, 0)
    middle: str = ""
    right: tuple = (0, 0)


class Source:
    """A file, its tree, and the edits that it has."""

    def __init__(self, text):
        self.text = text.encode()
        self.tree = PARSER.parse(self.text)
        self.lines = [0]
        for line in self.text.splitlines(keepends=True):
            self.lines.append(self.lines[-1] + len(line))

    def byte(self, place):
        """The byte of a line and a column, both from 1, columns in characters."""
        line = self.text[self.lines[place["line"] - 1]:].split(b"\n", 1)[0].decode()
        return self.lines[place["line"] - 1] + len(line[:place["column"] - 1].encode())

    def edit(self, number, mutant):
        """The edit of one mutant; raises Skipped."""
        start, end = self.byte(mutant["span"]["start"]), self.byte(mutant["span"]["end"])
        node = self.tree.root_node.descendant_for_byte_range(start, end)
        edit = getattr(self, "_" + {
            "FnValue": "function", "BinaryOperator": "binary", "UnaryOperator": "unary", "MatchArm": "arm", "MatchArmGuard": "guard",
        }.get(mutant["genre"], "other"))(number, mutant, node, start, end)
        self.refuse_constants(node)
        return edit

    def refuse_constants(self, node):
        child, function = None, False
        while node is not None:
            if node.type in CONSTANT:
                raise Skipped("in a constant")
            if node.type == "array_type" and node.child_by_field_name("length") == child:
                raise Skipped("in a constant")
            if node.type == "token_tree":
                raise Skipped("in a macro")
            if node.type == "function_item" and not function:
                function = True
                if any(child.type == "function_modifiers" and b"const" in child.text.split() for child in node.children):
                    raise Skipped("in a constant function")
            child, node = node, node.parent

    def _function(self, number, mutant, node, start, end):
        while node is not None and node.type != "function_item":
            node = node.parent
        if node is None or node.child_by_field_name("body") is None:
            raise Skipped("no function found")
        returned = node.child_by_field_name("return_type")
        if returned is not None and b"impl " in returned.text:
            raise Skipped("a function that returns an unnamed type")
        body = node.child_by_field_name("body").start_byte + 1
        return Edit(number, "return", body, body, middle=mutant["replacement"])

    def _binary(self, number, mutant, node, start, end):
        node = self.outer(node, {"binary_expression", "compound_assignment_expr"}, start, end)
        operator = node.child_by_field_name("operator") or node.children[1]
        if (operator.start_byte, operator.end_byte) != (start, end):
            raise Skipped("operator not found")
        return Edit(number, "replace", node.start_byte, node.end_byte, (node.start_byte, start), f" {mutant['replacement']} ",
                    (end, node.end_byte))

    def _unary(self, number, mutant, node, start, end):
        while node is not None and not (node.type in ("unary_expression", "negative_literal") and node.start_byte == start):
            node = node.parent
        if node is None:
            raise Skipped("operator not found")
        return Edit(number, "replace", node.start_byte, node.end_byte, (start, start), mutant["replacement"],
                    (node.start_byte + 1, node.end_byte))

    def _arm(self, number, mutant, node, start, end):
        node = self.outer(node, {"match_arm"}, start, end)
        pattern = node.child_by_field_name("pattern")
        guard = pattern.child_by_field_name("condition")
        if guard is None:
            return Edit(number, "arm", pattern.end_byte, pattern.end_byte, middle=f" if !crate::mutation::active({number})")
        return Edit(number, "arm", guard.start_byte, guard.start_byte, middle=f"!crate::mutation::active({number}) && ")

    def _guard(self, number, mutant, node, start, end):
        if (node.start_byte, node.end_byte) != (start, end):
            raise Skipped("guard not found")
        return Edit(number, "replace", start, end, (start, start), mutant["replacement"], (end, end))

    def _other(self, number, mutant, node, start, end):
        raise Skipped(f"a {mutant['genre']}")

    @staticmethod
    def outer(node, types, start, end):
        """The innermost node of these types around a range."""
        while node is not None and node.type not in types:
            node = node.parent
        if node is None:
            raise Skipped("operator not found")
        return node

    def render(self, edits):
        """The text with all edits, and where in it each lies: number -> ranges of bytes."""
        edits = sorted(edits, key=lambda edit: (edit.start, -edit.end, edit.number))
        return self._render(0, len(self.text), edits)

    def _render(self, start, end, edits):
        pieces, spans, length = [], [], 0

        def put(piece, inner=()):
            nonlocal length
            pieces.append(piece)
            spans.extend((number, low + length, high + length) for number, low, high in inner)
            length += len(piece)

        at = start
        while edits:
            edit, *edits = edits
            put(self.text[at:edit.start])
            first = length
            if edit.kind == "replace":
                inside = [other for other in edits if other.end <= edit.end and other.start >= edit.start]
                inside = [other for other in inside if other.start < edit.end or other.start > edit.start]
                edits = [other for other in edits if other not in inside]
                between = lambda low, high: [other for other in inside if low <= other.start and other.end <= high]
                put(f"(if crate::mutation::active({edit.number}) {{(".encode())
                put(*self._render(*edit.left, between(*edit.left)))
                put(edit.middle.encode())
                put(*self._render(*edit.right, between(*edit.right)))
                put(b")} else {(")
                put(*self._render(edit.start, edit.end, inside))
                put(b")})")
            elif edit.kind == "return":
                put(f" if crate::mutation::active({edit.number}) {{ return {edit.middle}; }} ".encode())
            else:
                put(edit.middle.encode())
            spans.append((edit.number, first, length))
            at = edit.end
        put(self.text[at:end])
        return b"".join(pieces), spans
