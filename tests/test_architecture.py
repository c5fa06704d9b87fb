"""Data flows one way: imports are read, and an arrow that runs back fails."""

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CORE = ROOT / "rust" / "core" / "src"
WIRE_FORMATS = ROOT / "rust" / "wire"
BINDINGS = ROOT / "rust" / "bindings" / "src"
PACKAGE = ROOT / "python" / "deadtime"

# What each room of the core may use besides itself; error, memory, status and task are for
# everyone.
FOUNDATION = {"error", "memory", "lanes", "status", "task"}
CORE_ARROWS = {
    "lambertw": set(),
    "elementary": set(),
    "quasipoly": {"elementary"},
    "roots": {"elementary", "lambertw", "quasipoly"},
    "stability": {"elementary", "lambertw", "quasipoly", "roots"},
    "dde": {"elementary", "quasipoly"},
    "frequency": {"elementary", "quasipoly", "roots", "stability"},
}

# Floors of the Python package, lowest first: a module uses its own floor and those below.
FLOORS = [
    {"_errors", "_frozen", "_validation", "_processes", "_deadtime", "_enclosures"},
    {
        "_certificate_parts",
        "_certificate_function",
        "_certificate_form",
        "_certificate_check",
        "_certificate",
    },
    {
        "_ufunc",
        "_special",
        "_chains",
        "_characteristic",
        "_expansion",
        "_special_forms",
        "_scalar_delay",
        "_low_level",
        "_compiled_function",
        "_delay_solution",
        "_solve_dde",
        "_rootset",
        "_sensitivity",
        "_parametric",
        "_quasipolynomial",
        "_plants",
        "_controllers",
        "_derivative_filter",
        "_response",
        "_loop",
        "_fixed_step",
        "_loop_model",
        "_loop_run",
        "_open_run",
        "_loop_sensitivities",
        "_loop_stability",
        "_batch",
        "_settled",
        "_sweep",
        "_map_axes",
        "_boundaries",
        "_crossings",
        "_stability",
        "_families",
        "_boxes",
        "_intervals",
        "_robust",
        "_stability_radius",
        "_determinant",
        "_matrix_roots",
        "_interchange",
        "_margins",
        "_sampled_gain",
        "_sampled_margins",
        "_sampled_march",
        "_sampled_ranges",
        "_transfer",
        "_systems",
        "_signals",
        "_signals_fit",
        "_realisation",
        "_system_response",
        "_system_run",
        "_simulation",
    },
    {"_recording", "_waves", "_circulating_noise", "_excitation", "_gallery_entries", "gallery"},
    {"_readers", "links"},
    {"_estimation", "_design"},
    {"_experiment", "_internet_loop", "_internet_replay", "_internet_result"},
    {"paper"},
    {"_plots"},
    {
        "_stability_plots",
        "_box_plots",
        "_design_plots",
        "_planning_plots",
        "_paper_plots",
        "_flight_plots",
        "_internet_plots",
    },
    {"_page"},
    {"_report", "_paper_page", "_flight_page"},
    {"_cli"},
]
NUMERICS = FLOORS[2]
#: The one file above the numerics that may import the native module: its wire formats.
WIRE = Path("links", "_wire.py")


def rust_sources(folder):
    return sorted(folder.rglob("*.rs"))


def room_of(path, folder):
    first = path.relative_to(folder).parts[0]
    return first.removesuffix(".rs")


def test_the_core_has_the_rooms_the_table_names():
    rooms = {room_of(path, CORE) for path in rust_sources(CORE)} - {"lib"}
    assert rooms == set(CORE_ARROWS) | FOUNDATION


@pytest.mark.parametrize("room", sorted(CORE_ARROWS))
def test_a_room_of_the_core_uses_only_what_stands_before_it(room):
    allowed = CORE_ARROWS[room] | FOUNDATION | {room, "Error", "Task"}
    for path in rust_sources(CORE / room):
        text = re.sub(r"//.*", "", path.read_text(encoding="utf-8"))
        used = set(re.findall(r"\bcrate::(\w+)", text))
        for group in re.findall(r"\bcrate::\{(.*?)\}\s*;", text, flags=re.DOTALL):
            used |= set(re.findall(r"(?:^|,)\s*(\w+)", group))
        assert used <= allowed, f"{path.name} of {room} uses {used - allowed}"


def test_the_foundation_of_the_core_stands_alone():
    for path in rust_sources(CORE):
        if room_of(path, CORE) in FOUNDATION:
            used = set(re.findall(r"\bcrate::(\w+)", path.read_text(encoding="utf-8")))
            assert used <= FOUNDATION | {"Error"}, path.name


def test_the_core_knows_nothing_of_python():
    for path in rust_sources(CORE):
        assert not re.search(r"\b(pyo3|numpy::)", path.read_text(encoding="utf-8")), path.name


def test_the_wire_formats_stand_alone():
    # What reads bytes from a network has nothing around it that could be unsafe or panic.
    manifest = tomllib.loads((WIRE_FORMATS / "Cargo.toml").read_text(encoding="utf-8"))
    assert manifest["dependencies"] == {}
    table_of_contents = (WIRE_FORMATS / "src" / "lib.rs").read_text(encoding="utf-8")
    assert "#![forbid(unsafe_code)]" in table_of_contents
    assert "#![deny(clippy::indexing_slicing)]" in table_of_contents


def test_only_one_file_of_the_seam_knows_the_wire_formats():
    users = [
        path.relative_to(ROOT).as_posix()
        for path in rust_sources(CORE) + rust_sources(BINDINGS)
        if "deadtime_wire" in path.read_text(encoding="utf-8")
    ]
    assert users == ["rust/bindings/src/wire.rs"]


def test_the_seam_holds_no_formula():
    # Converting needs no transcendental function; whoever needs one belongs in the core.
    for path in rust_sources(BINDINGS):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\.(exp|ln|sin|cos|sqrt|powi|powf)\(", text), path.name


def floor_of(module):
    for level, floor in enumerate(FLOORS):
        if module in floor:
            return level
    raise AssertionError(f"the module {module} is on no floor: add it to the table of this test")


def imports(path):
    """Modules of the package that a file imports when it is loaded."""
    found = set()

    def visit(node):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
                continue  # what a function imports when called is drawing, never numerics
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test):
                continue
            if isinstance(child, ast.ImportFrom) and child.module:
                parts = child.module.split(".")
                if parts == ["deadtime"]:
                    found.update(alias.name for alias in child.names)
                elif parts[0] == "deadtime":
                    found.add(parts[1])
            elif isinstance(child, ast.Import):
                for alias in child.names:
                    parts = alias.name.split(".")
                    if parts[0] == "deadtime" and len(parts) > 1:
                        found.add(parts[1])
            visit(child)

    visit(ast.parse(path.read_text(encoding="utf-8")))
    return found


def modules():
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if name not in ("__init__", "__main__"):
            yield name, path


def test_no_import_of_the_package_runs_upwards():
    for name, path in modules():
        level = floor_of(name)
        for used in imports(path):
            above = [other for other in FLOORS[level + 1 :] if used in other]
            assert not above, f"{path.relative_to(PACKAGE)} imports {used} from a floor above"


def test_only_numerics_import_the_native_module():
    for name, path in modules():
        if "_deadtime" in imports(path):
            place = path.relative_to(PACKAGE)
            assert name in NUMERICS or place == WIRE, f"{place} imports _deadtime"


def test_functions_import_only_drawing_and_optional_modules_late():
    for name, path in modules():
        if name in ("_cli", "_report") or name.endswith("_plots"):
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for function in ast.walk(tree):
            if not isinstance(function, (ast.FunctionDef, ast.AsyncFunctionDef)):
                continue
            for node in ast.walk(function):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("deadtime"):
                    drawing = node.module.endswith("_plots")
                    assert drawing, f"{path.name}: {node.module}"


def test_every_public_name_is_listed_once_and_in_order():
    text = (PACKAGE / "__init__.py").read_text(encoding="utf-8")
    listed = next(
        ast.literal_eval(node.value)
        for node in ast.parse(text).body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__"
    )
    assert len(listed) == len(set(listed))
    import deadtime

    for name in listed:
        assert hasattr(deadtime, name), name
