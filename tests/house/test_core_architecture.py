"""The Rust crates depend one way: `use` lines are read, and an arrow that runs back fails."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = next(folder for folder in Path(__file__).resolve().parents if (folder / "rust").is_dir())
CORE = ROOT / "rust" / "core" / "src"
WIRE_FORMATS = ROOT / "rust" / "wire"
BINDINGS = ROOT / "rust" / "bindings" / "src"

# What each package of the core may use besides itself; every package may use the foundation.
FOUNDATION = {
    "between",
    "error",
    "memory",
    "order",
    "parallel",
    "simd",
    "simplex",
    "status",
    "task",
}
CORE_ARROWS = {
    "linear_algebra": set(),
    "lambertw": set(),
    "elementary": set(),
    "quasipoly": {"elementary"},
    "roots": {"linear_algebra", "elementary", "lambertw", "quasipoly"},
    # Loops with a hold are stepped in `dde`.
    "stability": {"linear_algebra", "elementary", "lambertw", "quasipoly", "roots", "dde"},
    "frequency": {"elementary", "quasipoly", "roots", "dde", "stability"},
    "tuning": {
        "linear_algebra",
        "elementary",
        "quasipoly",
        "roots",
        "dde",
        "stability",
        "frequency",
        "loops",
    },
    "dde": {"linear_algebra", "elementary"},
    "loops": {
        "elementary",
        "linear_algebra",
        "quasipoly",
        "roots",
        "dde",
        "stability",
        "frequency",
    },
    "estimation": {"linear_algebra", "elementary", "quasipoly", "frequency", "dde", "loops"},
}

# Files and folders of a package in order: each uses only those before it.
ORDER = {
    "linear_algebra": [
        "vectors",
        "block_triangular",
        "rows",
        "banded",
        "elimination",
        "lu",
        "cholesky",
        "triangle",
        "singular",
        "symmetric",
        "balance",
        "hessenberg",
        "eigenvalues",
    ],
    "roots": ["region", "disc", "root_set", "chains", "counting", "locating", "ratio", "matrix"],
    "stability": [
        "family",
        "specification",
        "hold",
        "cell",
        "crossings",
        "branches",
        "boxes",
        "map",
        "held",
        "one_delay",
        "delayed",
    ],
    "frequency": [
        "two_sided",
        "bounds",
        "polynomial",
        "zeros",
        "waves",
        "squares",
        "ratio",
        "argument",
        "chains",
        "peaks",
        "norms",
        "margins",
        "gain_crossovers",
        "circle",
        "held_gain",
        "held_gain_range",
        "held_range",
        "further_delay",
        "held_peaks",
        "held",
        "equation",
        "passage",
        "multiples",
        "delays",
        "crossings",
        "ranges",
    ],
    "tuning": [
        "simplices",
        "survey",
        "open",
        "responses",
        "demands",
        "candidates",
        "goal",
        "search",
        "steps",
        "contraction",
        "lasting",
        "sampled_tail",
        "tail",
        "pattern",
        "exchange",
        "posed",
        "reach",
        "robust",
        "settling",
        "rules",
    ],
    "dde": ["scalar", "limits", "rate_limits", "propagator", "control_loop", "system", "spectral"],
    "loops": [
        "entry",
        "each",
        "symbol",
        "polynomial",
        "plant",
        "filter",
        "controller",
        "control_loop",
        "drive",
        "equations",
        "inputs",
        "rest",
        "settled",
        "load",
        "slopes",
        "sweep",
        "characteristic",
        "settling",
        "held",
        "plane",
        "range",
    ],
    "estimation": [
        "columns",
        "statistics",
        "shared",
        "stamps",
        "polynomial",
        "felt",
        "known_filter",
        "plant",
        "disturbance",
        "rows",
        "kept",
        "propagation",
        "steps",
        "path",
        "whiten",
        "noises",
        "kicks",
        "mean",
        "likelihood",
        "waves",
        "over_delays",
        "quotients",
        "search",
        "point",
        "variables",
        "fit",
        "profile",
        "flight",
        "online",
        "damped",
        "family",
        "least_squares",
        "literature",
        "screen",
        "commanded",
    ],
}


def rust_sources(folder):
    return sorted(folder.rglob("*.rs"))


def package_of(path):
    return path.relative_to(CORE).parts[0].removesuffix(".rs")


def code(path):
    """The text of a file without comments and without its tests."""
    text = re.sub(r"//.*", "", path.read_text(encoding="utf-8"))
    return re.split(r"#\[cfg\(test\)\]\s*mod \w+ \{", text)[0]


def module_of(path):
    parts = path.relative_to(CORE).with_suffix("").parts
    return parts[:-1] if parts[-1] in ("mod", "lib") else parts


MODULES = {module_of(path): path for path in rust_sources(CORE)}


def paths_in(tree, prefix=()):
    """The paths that a `use` tree names."""
    tree = tree.strip()
    head, brace, rest = tree.partition("{")
    names = tuple(name.strip() for name in head.split("::") if name.strip())
    if not brace:
        yield prefix + names[:-1] + (names[-1].split(" as ")[0],) if names else prefix
        return
    depth, part = 0, ""
    for letter in rest[: rest.rindex("}")] + ",":
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            if part.strip():
                yield from paths_in(part, prefix + names)
            part = ""
        else:
            part += letter


def resolved(module, path):
    """The file or folder of the core that a path leads to, as far as the path names one."""
    here = list(module)
    first, rest = path[0], list(path)
    if first == "crate":
        here, rest = [], rest[1:]
    elif first in ("super", "self"):
        while rest and rest[0] in ("super", "self"):
            if rest.pop(0) == "super":
                here.pop()
    else:
        return None
    full = (*here, *(name for name in rest if name != "self"))
    return next((full[:k] for k in range(len(full), -1, -1) if full[:k] in MODULES), None)


def uses(module, path):
    """Modules of the core that a file uses, in `use` lines and in paths within the code."""
    text = code(path)
    found = [p for tree in re.findall(r"\buse\s+([\w:{},*\s]+);", text) for p in paths_in(tree)]
    rest = re.sub(r"\buse\s+[\w:{},*\s]+;", "", text)
    found += [tuple(p.split("::")) for p in re.findall(r"\b(?:crate|super)(?:::\w+)+", rest)]
    targets = {resolved(module, names) for names in found}
    return targets - {None, module, ()}


USES = {
    module: uses(module, path)
    for module, path in MODULES.items()
    if path.stem not in ("mod", "lib", "tests")
}
FOLDERS = sorted({module[:-1] for module in USES})


def arrows(folder):
    """Which files and folders in `folder` use which others of them, with one example each."""
    depth = len(folder)
    found = {}
    for module, used in USES.items():
        if module[:depth] != folder:
            continue
        for target in used:
            if len(target) > depth and target[:depth] == folder and target[depth] != module[depth]:
                example = f"{'::'.join(module)} uses {'::'.join(target)}"
                found.setdefault((module[depth], target[depth]), example)
    return found


def circle(pairs):
    """A circle among pairs (user, used) as a list of names; empty where there is none."""
    users = {user for user, _ in pairs}
    left = {pair for pair in pairs if pair[1] in users}
    while len(left) < len(pairs):
        pairs = left
        users = {user for user, _ in pairs}
        left = {pair for pair in pairs if pair[1] in users}
    return sorted(users)


def test_paths_of_use_trees_are_read():
    assert list(paths_in("super::{a::B, c::{D, self as e}}")) == [
        ("super", "a", "B"),
        ("super", "c", "D"),
        ("super", "c", "self"),
    ]
    assert resolved(("roots", "counting", "cell"), ("super", "turn", "Turn")) == (
        "roots",
        "counting",
        "turn",
    )
    assert circle({("a", "b"), ("b", "c"), ("c", "b")}) == ["a", "b", "c"]
    assert circle({("a", "b"), ("b", "c"), ("a", "c")}) == []


def test_the_core_has_the_packages_the_table_names():
    packages = {package_of(path) for path in rust_sources(CORE)} - {"lib"}
    assert packages == set(CORE_ARROWS) | FOUNDATION


@pytest.mark.parametrize("package", sorted(CORE_ARROWS))
def test_a_package_of_the_core_uses_only_what_stands_before_it(package):
    allowed = CORE_ARROWS[package] | FOUNDATION | {package}
    for module, used in USES.items():
        if module[0] == package:
            packages = {target[0] for target in used}
            assert packages <= allowed, f"{'::'.join(module)} uses {packages - allowed}"


def test_the_foundation_of_the_core_stands_alone():
    for module, used in USES.items():
        if module[0] in FOUNDATION:
            assert {target[0] for target in used} <= FOUNDATION, "::".join(module)


@pytest.mark.parametrize("folder", FOLDERS, ids="::".join)
def test_no_circle_among_the_files_and_folders_of_a_folder(folder):
    found = arrows(folder)
    names = circle(set(found))
    examples = [text for pair, text in found.items() if set(pair) <= set(names)]
    assert not names, "\n".join(examples)


@pytest.mark.parametrize("package", sorted(ORDER))
def test_files_and_folders_of_a_package_use_only_those_before_them(package):
    order = ORDER[package]
    inside = {module[1] for module in MODULES if module[:1] == (package,) and len(module) > 1}
    assert inside - {"tests"} == set(order)
    for (user, used), example in arrows((package,)).items():
        assert order.index(used) < order.index(user), example


def test_files_use_what_defines_a_name_not_the_table_of_contents_above_it():
    for module, used in USES.items():
        above = {target for target in used if target == module[: len(target)]}
        assert not above, f"{'::'.join(module)} uses {above}"


def test_tables_of_contents_define_nothing():
    for path in CORE.rglob("mod.rs"):
        items = re.findall(
            r"^(?:pub(?:\(\w+\))? )?(?:fn|struct|enum|trait|impl|const) .*", code(path), re.M
        )
        assert not items, f"{path.relative_to(CORE)} defines {items}"


def test_the_core_knows_nothing_of_python():
    for path in rust_sources(CORE):
        assert not re.search(r"\b(pyo3|numpy::)", path.read_text(encoding="utf-8")), path.name


def test_the_wire_formats_stand_alone():
    # The crate that reads bytes from a network has no unsafe code and no panics of its own.
    # thiserror writes the texts of its errors while it is compiled, and is no part of what runs;
    # memchr finds bytes in a table.
    manifest = tomllib.loads((WIRE_FORMATS / "Cargo.toml").read_text(encoding="utf-8"))
    assert manifest["dependencies"].keys() <= {"memchr", "thiserror"}
    table_of_contents = (WIRE_FORMATS / "src" / "lib.rs").read_text(encoding="utf-8")
    assert "#![forbid(unsafe_code)]" in table_of_contents
    assert "#![deny(clippy::indexing_slicing)]" in table_of_contents


def test_two_files_of_the_seam_know_the_wire_formats():
    users = [
        path.relative_to(ROOT).as_posix()
        for path in rust_sources(CORE) + rust_sources(BINDINGS)
        if "deadtime_wire" in path.read_text(encoding="utf-8")
    ]
    assert users == ["rust/bindings/src/csv.rs", "rust/bindings/src/wire.rs"]


def test_the_seam_holds_no_formula():
    # Conversion needs no transcendental function; code that needs one belongs in the core.
    for path in rust_sources(BINDINGS):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\.(exp|ln|sin|cos|sqrt|powi|powf)\(", text), path.name


def test_the_page_only_converts():
    # It had a search of its own, with copies of the constants of the package's.
    lines = [
        line.strip()
        for path in rust_sources(CORE.parents[1] / "web")
        for line in code(path).splitlines()
    ]
    assert sum(1 for line in lines if line) <= 500
