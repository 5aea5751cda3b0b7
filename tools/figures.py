"""Count what describes the code of ``src``: lines, names, numbers, settings, options, circles. ``make figures``.

These figures describe; they are no targets of their own. Nothing is imported but the command line, for its options.
"""

import ast
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).parent.parent / "src" / "pneumarm"
LONG = 60
"""Lines of a function that is counted as long."""


def numbers(value: ast.expr | None) -> bool:
    """Return whether ``value`` is a number, or a tuple of numbers, perhaps negative or made of arithmetic."""
    match value:
        case ast.Constant(value=bool()):
            return False
        case ast.Constant(value=int() | float() | complex()):
            return True
        case ast.UnaryOp(operand=operand):
            return numbers(operand)
        case ast.BinOp(left=left, right=right):
            return numbers(left) and numbers(right)
        case ast.Tuple(elts=elements):
            return bool(elements) and all(map(numbers, elements))
    return False


def module_numbers(tree: ast.Module) -> Iterator[ast.stmt]:
    """Give the statements that bind a module-level name to a number."""
    for statement in tree.body:
        match statement:
            case ast.Assign(value=value) | ast.AnnAssign(value=value) if numbers(value):
                yield statement
            case ast.Assign(targets=[ast.Tuple()], value=ast.Tuple(elts=values)) if all(map(numbers, values)):
                yield statement


def bound(statement: ast.stmt) -> int:
    """Return how many names a statement of :func:`module_numbers` binds."""
    target = statement.targets[0] if isinstance(statement, ast.Assign) else None
    return len(target.elts) if isinstance(target, ast.Tuple) else 1


def literals(tree: ast.Module) -> int:
    """Return how many numbers stand in code, other than 0, 1, -1, 2 and those bound to module-level names."""
    named = {id(node) for statement in module_numbers(tree) for node in ast.walk(statement)}
    return sum(
        isinstance(node, ast.Constant)
        and type(node.value) in (int, float)
        and node.value not in (0, 1, 2)
        and id(node) not in named
        for node in ast.walk(tree)
    )


def is_dataclass(node: ast.ClassDef) -> bool:
    """Return whether ``node`` is decorated as a dataclass."""
    return any("dataclass" in ast.unparse(decorator) for decorator in node.decorator_list)


def settings_fields(tree: ast.Module) -> int:
    """Return the fields of dataclasses whose name or base says that they are settings."""
    count = 0
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and is_dataclass(node):
            bases = [ast.unparse(base) for base in node.bases]
            if node.name.endswith("Settings") or any("Settings" in base for base in bases):
                count += sum(isinstance(one, ast.AnnAssign) for one in node.body)
    return count


def public_names(tree: ast.Module) -> Iterator[str]:
    """Give the public functions, classes and other names of a module, without the members of classes."""
    for node in tree.body:
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) if not name.startswith("_"):
                yield name
            case ast.ClassDef(name=name) if not name.startswith("_"):
                yield name
            case ast.Assign(targets=targets):
                for target in targets:
                    for one in target.elts if isinstance(target, ast.Tuple) else [target]:
                        if isinstance(one, ast.Name) and not one.id.startswith("_"):
                            yield one.id
            case ast.AnnAssign(target=ast.Name(id=name)) if not name.startswith("_"):
                yield name


def imports(tree: ast.Module, modules: set[str]) -> set[str]:
    """Return the modules of ``modules`` that ``tree`` imports anywhere, in functions too, by name."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            for one in node.names:
                whole = f"{node.module}.{one.name}"
                found.add(whole if whole in modules else node.module)
        elif isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
    return found & modules


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return the sets of modules that import each other (strongly connected components of more than one)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in graph[node]:
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            part = []
            while not part or part[-1] != node:
                part.append(stack.pop())
            if len(part) > 1:
                found.append(sorted(part))

    for node in graph:
        if node not in index:
            visit(node)
    return found


def options(*flags: str) -> int:
    """Return how many options ``pneumarm run`` lists with ``flags``."""
    done = subprocess.run(
        [sys.executable, "-m", "pneumarm", "run", *flags],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"COLUMNS": "200"},
    )
    return len({word for word in done.stdout.split() if word.startswith("--") and len(word) > 2})


def main() -> None:
    """Print the figures."""
    sys.setrecursionlimit(10_000)
    trees = {path: ast.parse(path.read_text()) for path in sorted(SOURCE.rglob("*.py"))}
    names = {
        ".".join(path.relative_to(SOURCE.parent).with_suffix("").parts).removesuffix(".__init__"): path
        for path in trees
    }
    lines = {path: len(path.read_text().splitlines()) for path in trees}
    total = sum(lines.values())

    by_folder: Counter[str] = Counter()
    for path, count in lines.items():
        place = path.relative_to(SOURCE)
        by_folder[place.parts[0] + "/" if len(place.parts) > 1 else "(package)"] += count
    print("lines per folder")
    for folder, count in by_folder.most_common():
        print(f"  {folder:<16}{count:>7,}")
    print(f"  {'together':<16}{total:>7,}")

    public = sum(len(list(public_names(tree))) for tree in trees.values())
    print(f"numeric names         {sum(bound(s) for tree in trees.values() for s in module_numbers(tree)):>7,}")
    print(f"other numbers         {sum(map(literals, trees.values())):>7,}   (without 0, 1, 2)")
    print(f"settings fields       {sum(map(settings_fields, trees.values())):>7,}")
    print(f"public names          {public:>7,}   {1000 * public / total:.1f} per 1,000 lines")

    classes: Counter[str] = Counter()
    functions: Counter[str] = Counter()
    for tree in trees.values():
        classes.update(node.name for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
        functions.update(n.name for n in tree.body if isinstance(n, ast.FunctionDef) and not n.name.startswith("_"))
    for what, counted in (("class names twice", classes), ("function names twice", functions)):
        twice = sorted(name for name, count in counted.items() if count > 1)
        print(f"{what:<22}{len(twice):>7,}   {', '.join(twice[:12])}{' ...' if len(twice) > 12 else ''}")

    found = circles({name: imports(trees[path], set(names)) - {name} for name, path in names.items()})
    print(f"import circles        {len(found):>7,}")
    for circle in found:
        print(f"    {', '.join(name.removeprefix('pneumarm.') for name in circle)}")

    long = [
        f"{path.relative_to(SOURCE)}:{node.name}"
        for path, tree in trees.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and (node.end_lineno or 0) - node.lineno + 1 > LONG
    ]
    print(f"functions over {LONG} lines {len(long):>6,}")
    for one in long:
        print(f"    {one}")

    shown, every = options("--help"), options("--help-all")
    print(f"options of run        {shown:>7,} shown, {every - shown:,} hidden")


if __name__ == "__main__":
    main()
