"""What docs/security.md promises of the code: nothing here runs what a stranger's file or message says."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FILES = [p for folder in ("digit_driver", "midastouch_*", "docker", "tools") for p in ROOT.glob(f"{folder}/**/*.py")]
SOURCES = sorted(p for p in FILES if not {"test", "build", "install"} & set(p.relative_to(ROOT).parts))
FORBIDDEN = {
    "eval", "exec", "compile", "__import__", "os.system", "os.popen", "pickle.load", "pickle.loads", "yaml.load",
    "yaml.unsafe_load", "yaml.full_load", "marshal.loads", "shelve.open", "joblib.load", "tempfile.mktemp",
    "tarfile.TarFile.extractall", "shutil.unpack_archive",
}  # fmt: skip
METHODS = {"extractall"}
# Keyword arguments that no call may have with this value.
ARGUMENTS = {"allow_pickle": True, "shell": True, "weights_only": False, "verify": False}


def offences(source: str) -> list[str]:
    """Forbidden calls in a Python source, as line: what."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.Call):
            continue
        name = ast.unparse(node.func)
        if name in FORBIDDEN or (isinstance(node.func, ast.Attribute) and node.func.attr in METHODS):
            found.append(f"{node.lineno}: {name}")
        for keyword in node.keywords:
            if keyword.arg in ARGUMENTS and getattr(keyword.value, "value", None) is ARGUMENTS[keyword.arg]:
                found.append(f"{node.lineno}: {name}({keyword.arg}={ARGUMENTS[keyword.arg]})")
        given = {keyword.arg for keyword in node.keywords}
        if name == "torch.load" and "weights_only" not in given:
            found.append(f"{node.lineno}: torch.load without weights_only")
    return found


def test_no_source_has_a_forbidden_call():
    assert len(SOURCES) > 150
    found = {path.relative_to(ROOT).as_posix(): offences(path.read_text()) for path in SOURCES}
    assert {path: calls for path, calls in found.items() if calls} == {}


@pytest.mark.parametrize(
    "source",
    [
        "eval(x)", "pickle.loads(x)", "yaml.load(x)", "np.load(x, allow_pickle=True)", "torch.load(x)",
        "subprocess.run(x, shell=True)", "torch.load(x, weights_only=False)", "archive.extractall(x)",
    ],
)  # fmt: skip
def test_each_of_them_would_be_found(source):
    assert len(offences(source)) == 1
