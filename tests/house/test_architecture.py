"""Data flows one way: an import from a later package fails."""

import ast
import functools
from pathlib import Path

import deadtime
import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "python" / "deadtime"

# The packages inside of `deadtime`, in order: a file imports from its own package and from those
# above it in this list. This includes late imports and imports for types.
PACKAGES = [
    "_base",
    "special",
    "dde",
    "roots",
    "systems",
    "loops",
    "stability",
    "recordings",
    "experiments",
    "gallery",
    "links",
    "estimation",
    "tuning",
    "reports",
    "logs",
    "flights",
    "internet",
    "paper",
    "_cli",
]

#: Imports for types from a later package, with the reason.
BACKWARDS = {
    # The annotation of a quotient of two quasi-polynomials is a transfer function.
    ("roots._quasipolynomial", "systems"),
}


def modules():
    """Dotted name within `deadtime`, and path, of every file of a package."""
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        if len(parts) > 1:
            yield ".".join(parts), path


NAMES = {name for name, _ in modules()}


@functools.cache
def imports(path):
    """What a file imports from the package, wherever in the file: (module, name)."""
    return list(_imports(path))


def _imports(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}: import by the full name of the package"
            first, _, rest = (node.module or "").partition(".")
            if first == "deadtime":
                yield from ((rest, alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            for alias in node.names:
                first, _, rest = alias.name.partition(".")
                if first == "deadtime":
                    yield rest, ""


def package(module):
    return module.split(".")[0]


def test_the_packages_are_those_of_the_list():
    assert {package(name) for name in NAMES} == set(PACKAGES)


def test_no_import_runs_back():
    for name, path in modules():
        allowed = PACKAGES[: PACKAGES.index(package(name)) + 1]
        for module, imported in imports(path):
            if module == "":
                # The reproduction of the paper uses the package as its users do.
                assert imported == "_deadtime" or package(name) == "paper", f"{name}: {imported}"
            elif module != "_deadtime" and (name, package(module)) not in BACKWARDS:
                assert package(module) in allowed, f"{name} imports {module}"


def test_a_package_does_not_import_from_its_own_init():
    for name, path in modules():
        for module, _ in imports(path):
            assert module != package(name) or module in ("paper", "_cli"), (
                f"{name} imports {module}"
            )


def files_used(name, path):
    """The files of its own package that a file imports."""
    for module, imported in imports(path):
        if package(module) != package(name) or module.endswith("_plots"):
            continue  # A result imports its drawing functions late, and these import the result.
        for target in (f"{module}.{imported}", module, f"{module}.__init__"):
            if target in NAMES and target != name:
                yield target
                break


@pytest.mark.parametrize("which", PACKAGES)
def test_no_files_of_a_package_import_in_a_circle(which):
    arrows = {n: set(files_used(n, p)) for n, p in modules() if package(n) == which}
    while arrows:
        last = [name for name, used in arrows.items() if not used]
        assert last, f"in a circle, or below one: {sorted(arrows)}"
        for name in last:
            del arrows[name]
        for used in arrows.values():
            used -= set(last)


def is_native(module, imported):
    return module == "_deadtime" or (module == "" and imported == "_deadtime")


def test_each_package_imports_the_native_module_in_one_file():
    for name, path in modules():
        if name != f"{package(name)}._native":
            for module, imported in imports(path):
                assert not is_native(module, imported), f"{name} imports _deadtime"


def test_no_import_reaches_into_a_private_file_of_another_package():
    for name, path in modules():
        for module, imported in imports(path):
            if module and package(module) not in (package(name), "_base", "_deadtime"):
                inside = [*module.split(".")[1:], imported]
                assert not any(part.startswith("_") for part in inside), f"{name}: {module}"


def test_public_names_are_those_of_the_packages():
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    shown = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("deadtime."):
            shown |= {alias.name: node.module.removeprefix("deadtime.") for alias in node.names}
    assert shown == deadtime._PACKAGE_OF
    assert sorted(shown) == sorted(deadtime.__all__)
    for name in deadtime.__all__:
        assert getattr(deadtime, name) is not None
