"""Docstrings of the Python API have numpydoc's sections: parameters, results, errors, attributes.

The nodes are thin, so the API is what those of a robot and the examples import, and what packages export. There, every
function, and every class or method, that takes two or more parameters needs sections. Everywhere, sections of
parameters are complete.
"""

import ast
import importlib
import re
from collections.abc import Iterator

import packages
import pytest

PACKAGES = [package for package in packages.PYTHON if package != "midastouch_benchmark"]
MODULES = {name: path for package in PACKAGES for name, path in packages.modules(package).items()}
THIN = {"nodes", "ros", "commands"}
"""Folders whose modules use the API and are no part of it."""


def definitions(name: str) -> dict[str, ast.FunctionDef | ast.ClassDef]:
    """Functions and classes of a module."""
    tree = ast.parse(MODULES[name].read_text())
    return {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}


DEFINED = {name: definitions(name) for name in MODULES}


def bases(node: ast.AST) -> set[str]:
    return {ast.unparse(base) for base in getattr(node, "bases", ())}


def methods(node: ast.AST | None) -> dict[str, ast.FunctionDef]:
    return {each.name: each for each in getattr(node, "body", ()) if isinstance(each, ast.FunctionDef)}


def callables(module: str, node: ast.FunctionDef | ast.ClassDef) -> Iterator[tuple[str, str, ast.FunctionDef]]:
    """Dotted name, docstring and parameters' function of each public callable; a class stands for its `__init__`."""
    name = f"{module}.{node.name}"
    if isinstance(node, ast.FunctionDef):
        yield name, ast.get_docstring(node) or "", node
        return
    protocols = {each.name for each in DEFINED[module].values() if "Protocol" in bases(each)} - {node.name}
    above = bases(node) | protocols
    described = {method for base in above for nodes in DEFINED.values() for method in methods(nodes.get(base))}
    for each, method in methods(node).items():
        if each == "__init__":
            yield name, ast.get_docstring(node) or "", method
        elif not each.startswith("_") and each not in described:
            yield f"{name}.{each}", ast.get_docstring(method) or "", method


CALLABLES = {
    dotted: (docstring, function)
    for module, nodes in DEFINED.items()
    for name, node in nodes.items()
    if not name.startswith("_")
    for dotted, docstring, function in callables(module, node)
}


def homes(module: str, name: str) -> set[str]:
    """Dotted names of the module, function or class that `from module import name` gives, if it is ours."""
    if f"{module}.{name}" in MODULES or name in DEFINED.get(module, ()):
        return {f"{module}.{name}"}
    # a package has it from one of its modules
    return {f"{each}.{name}" for each in MODULES if each.startswith(f"{module}.") and name in DEFINED[each]}


def api() -> set[str]:
    """Dotted names of the modules, functions and classes of the API."""
    # the nodes of midastouch_tools belong to its command line
    users = [path for name, path in MODULES.items() if ".nodes." in name and not name.startswith("midastouch_tools.")]
    users += packages.ROOT.glob("examples/*.py")
    wanted = {(module, name) for path in users for _, module, names in packages.imports(path) for name in names}
    for package in PACKAGES:
        wanted |= {(package, name) for name in getattr(importlib.import_module(package), "__all__", ())}
    found = {home for module, name in wanted for home in homes(module, name)}
    return {name for name in found if not THIN & {*name.split(".")}}


def parameters(function: ast.FunctionDef) -> list[str]:
    of = function.args
    return [each.arg for each in (*of.posonlyargs, *of.args, *of.kwonlyargs) if each.arg not in {"self", "cls"}]


def needs_sections() -> list[str]:
    """Dotted names."""
    names = api()
    return [
        name
        for name, (_, function) in CALLABLES.items()
        if len(parameters(function)) > 1 and any(f"{name}.".startswith(f"{each}.") for each in names)
    ]


def sections(docstring: str) -> dict[str, str]:
    """Texts of the sections by heading."""
    parts = re.split(r"^(\w+)\n-{3,}\n", docstring, flags=re.M)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def entries(section: str) -> list[str]:
    """Names that a section describes."""
    lines = re.findall(r"^(\S.*?)(?: : .*)?$", section, flags=re.M)
    return [name for line in lines for name in line.split(", ")]


def raised(node: ast.AST) -> Iterator[str]:
    """Classes of the errors that a function makes and raises, except within `try`, which may catch them."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef) or (isinstance(node, ast.Try) and child in node.body):
            continue
        if isinstance(child, ast.Raise) and isinstance(child.exc, ast.Call):
            yield ast.unparse(child.exc.func)
        yield from raised(child)


def faults(docstring: str, function: ast.FunctionDef) -> list[str]:
    """Sections that are missing or incomplete.

    Results need one if they have a shape or a unit, which annotations lack: arrays and floats, also several.
    """
    found, wanted = sections(docstring), parameters(function)
    missing = []
    if entries(found.get("Parameters", "")) != wanted:
        missing.append(f"Parameters: {', '.join(wanted)}")
    annotation = ast.unparse(function.returns) if function.returns else ""
    if re.search(r"\b(ndarray|float)\b", annotation) and not {"Returns", "Yields"} & {*found}:
        missing.append("Returns")
    errors = {name for name in raised(function) if name[0].isupper()}
    return missing + [f"Raises: {name}" for name in sorted(errors - {*entries(found.get("Raises", ""))})]


def test_names_of_the_api_have_sections():
    names = needs_sections()
    assert len(names) > 100
    assert {name: found for name in names if (found := faults(*CALLABLES[name]))} == {}


def test_sections_are_complete():
    names = [name for name, (docstring, _) in CALLABLES.items() if "Parameters" in sections(docstring)]
    assert len(names) > 140
    assert {name: found for name in names if (found := faults(*CALLABLES[name]))} == {}


def test_sections_of_attributes_name_the_fields():
    classes = [node for nodes in DEFINED.values() for node in nodes.values() if isinstance(node, ast.ClassDef)]
    described = {node: sections(ast.get_docstring(node) or "").get("Attributes") for node in classes}
    described = {node: entries(section) for node, section in described.items() if section}
    assert len(described) > 5
    for node, names in described.items():
        fields = [each.target.id for each in node.body if isinstance(each, ast.AnnAssign)]
        assert names == fields, node.name


EXAMPLE = '''def load(path: str, size: int, strict: bool = False) -> np.ndarray:
    """Load.

    Parameters
    ----------
    path
        The file: a text.
    size : [pixels]
    strict

    Returns
    -------
    (N,) [m]

    Raises
    ------
    InputError
        It is empty.
    """
    try:
        raise ValueError("no")
    except ValueError as error:
        raise InputError(str(error)) from error
'''


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ("", "", []),
        ("strict\n\n", "stern\n\n", ["Parameters: path, size, strict"]),
        ("Returns", "Notes", ["Returns"]),
        ("    InputError\n", "    OSError\n", ["Raises: InputError"]),
    ],
)
def test_faults_are_found(old, new, found):
    function = ast.parse(EXAMPLE.replace(old, new)).body[0]
    assert faults(ast.get_docstring(function), function) == found
