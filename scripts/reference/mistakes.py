"""Small mistakes in a function, of the kinds that reviewers miss.

They decide what is worth holding: a call of a function, with the arguments of a test or with some near them, is held
where it returns something else with a mistake that no call before it has shown.
"""

import ast
import random
import types
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

MOST = 60
"""Mistakes in a function, at most."""

OF_A_LINE = 3
"""Mistakes of a line of it."""

Edit = tuple[ast.AST, str, object]
"""A node, one of its fields, and what stands there instead."""

_OTHER_COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.GtE),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.LtE),
    ast.Eq: (ast.NotEq, ast.LtE, ast.GtE),
    ast.NotEq: (ast.Eq, ast.Lt, ast.Gt),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}

_OTHER_OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Div,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
}


def of(code: types.CodeType) -> list[types.CodeType]:
    """A function's code with one mistake each, the same every time.

    Args:
        code: Of a function of a module that is on disk; of another one, and of a lambda, there are none.
    """
    if not Path(code.co_filename).is_file():
        return []
    function = _functions(code.co_filename).get(code.co_firstlineno)
    if function is None or function.name != code.co_name:
        return []
    return [*_coded(function, code)]


@cache
def _functions(file: str) -> dict[int, ast.FunctionDef]:
    """Those of a module, by their first line, with their decorators'."""
    found = {}
    for node in ast.walk(ast.parse(Path(file).read_text(encoding="utf-8"), file)):
        if isinstance(node, ast.FunctionDef):
            found[min([node.lineno, *(each.lineno for each in node.decorator_list)])] = node
    return found


def _coded(function: ast.FunctionDef, code: types.CodeType) -> Iterator[types.CodeType]:
    arguments, returns = function.args, function.returns
    bare = ast.FunctionDef(function.name, arguments, function.body, [], returns, lineno=1, col_offset=0)
    outer = ast.parse("def outer(): pass")
    cells = [ast.parse(f"{name} = None").body[0] for name in code.co_freevars]
    outer.body[0] = ast.FunctionDef("outer", _no_arguments(), [*cells, bare], [], lineno=1, col_offset=0)
    count = code.co_argcount + code.co_kwonlyargcount
    for node, field, instead in _chosen(bare):
        was = getattr(node, field)
        setattr(node, field, instead)
        try:
            made = _inner(
                compile(ast.fix_missing_locations(outer), code.co_filename, "exec", dont_inherit=True), code.co_name
            )
        except (SyntaxError, ValueError, TypeError):  # a name that is assigned nowhere, a string in the wrong place
            continue
        finally:
            setattr(node, field, was)
        if {*made.co_freevars} <= {*code.co_freevars} and made.co_varnames[:count] == code.co_varnames[:count]:
            yield made


def _no_arguments() -> ast.arguments:
    return ast.arguments([], [], None, [], [], None, [])


def _inner(module: types.CodeType, name: str) -> types.CodeType:
    (outer,) = (each for each in module.co_consts if isinstance(each, types.CodeType))
    return next(each for each in outer.co_consts if isinstance(each, types.CodeType) and each.co_name == name)


def _chosen(function: ast.FunctionDef) -> list[Edit]:
    """So many mistakes of each line, and of the function."""
    rng = random.Random(zlib.crc32(ast.dump(function).encode()))
    of_line: dict[int, list[Edit]] = defaultdict(list)
    for line, edit in _edits(function):
        of_line[line].append(edit)
    found = [edit for edits in of_line.values() for edit in rng.sample(edits, min(len(edits), OF_A_LINE))]
    return found if len(found) <= MOST else rng.sample(found, MOST)


def _edits(function: ast.FunctionDef) -> Iterator[tuple[int, Edit]]:
    """What could be another thing in it, with its line."""
    scope = _scope(function)
    body = function.body[1:] if ast.get_docstring(function) is not None else function.body
    nodes = [node for statement in body for node in ast.walk(statement)]
    for node in nodes:
        for edit in _OF.get(type(node), _nothing)(node, scope):
            yield getattr(node, "lineno", 0), edit
    for node in (function, *nodes):
        for field in ("body", "orelse", "finalbody"):
            statements = getattr(node, field, None)
            for k, statement in enumerate(statements if isinstance(statements, list) else ()):
                if isinstance(statement, _LOST) and not _is_docstring(statement):
                    yield statement.lineno, (node, field, [*statements[:k], ast.Pass(), *statements[k + 1 :]])


_LOST = (ast.Expr, ast.AugAssign, ast.If, ast.For, ast.Return)
"""Statements without which the others still have their names."""


def _is_docstring(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


class _Scope(NamedTuple):
    """Names of a function, and the attributes that it uses, by what they are of."""

    names: list[str]
    attributes: dict[str, list[str]]


def _scope(function: ast.FunctionDef) -> _Scope:
    given, nodes = function.args, [*ast.walk(function)]
    own = [each.arg for each in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    own += [node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    attributes: dict[str, list[str]] = defaultdict(list)
    for node in nodes:
        if isinstance(node, ast.Attribute):
            attributes[ast.dump(node.value)].append(node.attr)
    return _Scope([*dict.fromkeys(name for name in own if name not in ("self", "cls"))], attributes)


def _nothing(node: Any, scope: _Scope) -> Iterator[Edit]:
    yield from ()


def _of_comparison(node: ast.Compare, scope: _Scope) -> Iterator[Edit]:
    for k, was in enumerate(node.ops):
        for other in _OTHER_COMPARISONS[type(was)]:
            yield node, "ops", [*node.ops[:k], other(), *node.ops[k + 1 :]]


def _of_junction(node: ast.BoolOp, scope: _Scope) -> Iterator[Edit]:
    yield node, "op", ast.And() if isinstance(node.op, ast.Or) else ast.Or()
    for k in range(len(node.values)):
        rest = [*node.values[:k], *node.values[k + 1 :]]
        yield node, "values", rest if len(rest) > 1 else rest * 2


def _of_operation(node: ast.BinOp, scope: _Scope) -> Iterator[Edit]:
    if (other := _OTHER_OPERATORS.get(type(node.op))) is not None:
        yield node, "op", other()
    if isinstance(node.op, ast.Sub | ast.Div):
        yield node, "right", ast.Constant(0.0 if isinstance(node.op, ast.Sub) else 1.0)


def _of_sign(node: ast.UnaryOp, scope: _Scope) -> Iterator[Edit]:
    if isinstance(node.op, ast.USub):
        yield node, "op", ast.UAdd()
    elif isinstance(node.op, ast.Not):
        yield node, "operand", ast.UnaryOp(ast.Not(), node.operand)


def _of_branch(node: ast.If | ast.IfExp | ast.While, scope: _Scope) -> Iterator[Edit]:
    is_taken = not isinstance(node, ast.While) and zlib.crc32(ast.dump(node.test).encode()) % 2 == 0
    yield node, "test", ast.Constant(is_taken)


def _of_constant(node: ast.Constant, scope: _Scope) -> Iterator[Edit]:
    was = node.value
    others: tuple[object, ...] = ()
    if isinstance(was, bool):
        others = (not was,)
    elif isinstance(was, int):
        others = (was + 1, was - 1)
    elif isinstance(was, float):
        others = (2.0 * was if was else 1.0, -was if was else -1.0)
    elif isinstance(was, str) and was:
        others = (f"{was}x", was[1:])
    for other in others:
        yield node, "value", other


def _of_name(node: ast.Name, scope: _Scope) -> Iterator[Edit]:
    if isinstance(node.ctx, ast.Load) and node.id in scope.names:
        for other in scope.names:
            if other != node.id:
                yield node, "id", other


def _of_attribute(node: ast.Attribute, scope: _Scope) -> Iterator[Edit]:
    if isinstance(node.ctx, ast.Load):
        for other in dict.fromkeys(scope.attributes[ast.dump(node.value)]):
            if other != node.attr:
                yield node, "attr", other


def _of_call(node: ast.Call, scope: _Scope) -> Iterator[Edit]:
    is_plain = not any(isinstance(each, ast.Starred) for each in node.args)
    if len(node.args) > 1 and is_plain:
        yield node, "args", [node.args[1], node.args[0], *node.args[2:]]
        yield node, "args", node.args[:-1]
    for k in range(len(node.keywords)):
        yield node, "keywords", [*node.keywords[:k], *node.keywords[k + 1 :]]
    if len(node.args) == 1 and not node.keywords and is_plain:
        yield node, "func", ast.parse("(lambda _: _)", mode="eval").body


def _of_slice(node: ast.Slice, scope: _Scope) -> Iterator[Edit]:
    for field in ("lower", "upper", "step"):
        if getattr(node, field) is not None:
            yield node, field, None


def _of_comprehension(node: ast.comprehension, scope: _Scope) -> Iterator[Edit]:
    if node.ifs:
        yield node, "ifs", node.ifs[1:]


def _of_format(node: ast.FormattedValue, scope: _Scope) -> Iterator[Edit]:
    if node.format_spec is not None:
        yield node, "format_spec", None


def _of_sequence(node: ast.Tuple | ast.List, scope: _Scope) -> Iterator[Edit]:
    if isinstance(node.ctx, ast.Load) and len(node.elts) > 1:
        yield node, "elts", [*node.elts[1:], node.elts[0]]
        yield node, "elts", node.elts[:-1]


_OF: dict[type[ast.AST], Callable[[Any, _Scope], Iterator[Edit]]] = {
    ast.Compare: _of_comparison,
    ast.BoolOp: _of_junction,
    ast.BinOp: _of_operation,
    ast.UnaryOp: _of_sign,
    **dict.fromkeys((ast.If, ast.IfExp, ast.While), _of_branch),
    ast.Constant: _of_constant,
    ast.Name: _of_name,
    ast.Attribute: _of_attribute,
    ast.Call: _of_call,
    ast.Slice: _of_slice,
    ast.comprehension: _of_comprehension,
    ast.FormattedValue: _of_format,
    **dict.fromkeys((ast.Tuple, ast.List), _of_sequence),
}
"""What could be another thing in a node."""
