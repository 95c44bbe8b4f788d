"""Direction of imports between layers."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CONTRACTS = {
    contract["id"]: contract
    for contract in tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
        "importlinter"
    ]["contracts"]
}


def lint_imports(directory: Path) -> subprocess.CompletedProcess[str]:
    """Run import-linter on the packages below a directory, without its cache."""
    return subprocess.run(
        [Path(sys.executable).with_name("lint-imports"), "--no-cache"],
        cwd=directory,
        capture_output=True,
        text=True,
        check=False,
        env={"PYTHONPATH": str(directory), "NO_COLOR": "1", "COLUMNS": "200"},
    )


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """Copy of the configuration and of all Python files, for tests that modify them."""
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    for package in ("app", "identification", "bench", "motorid"):
        shutil.copytree(
            ROOT / package,
            tmp_path / package,
            ignore=lambda folder, names: [
                name for name in names if (Path(folder) / name).is_file() and name[-3:] != ".py"
            ],
        )
    return tmp_path


def test_every_module_of_the_library_belongs_to_a_layer() -> None:
    """A module outside the layers could import anything; the reference is the folder."""
    folder = ROOT / "identification"
    modules = {
        f"identification.{entry.stem}"
        for entry in folder.iterdir()
        if (entry.suffix == ".py" and entry.name != "__init__.py")
        or (entry / "__init__.py").is_file()
    }

    layers = {name for layer in CONTRACTS["layers"]["layers"] for name in layer.split(" | ")}

    assert layers == modules | {"app"}


def test_every_module_of_the_application_stands_in_the_layers() -> None:
    """As for the library: the files are the expected list, and each layer names some of them."""
    layers = CONTRACTS["application"]["layers"]
    named = {name for layer in layers for name in layer.split(" | ")}
    modules = {
        path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
        for path in (ROOT / "app").rglob("*.py")
        if path.name != "__init__.py"
    }

    covered = {
        module for module in modules for name in named if f"{module}.".startswith(f"{name}.")
    }

    assert modules == covered


def test_decision_shows_the_layers_that_are_checked() -> None:
    """Decision 0001 lists the layers of pyproject.toml, without the name of the package."""
    page = ROOT / "docs" / "adr" / "0001-layers-and-direction-of-imports.md"
    lines = [line for line in page.read_text(encoding="utf-8").splitlines() if " > " in line]

    shown = [name.strip() for name in " ".join(lines).split(">")]

    assert shown == [name.removeprefix("identification.") for name in CONTRACTS["layers"]["layers"]]


@pytest.mark.parametrize("role", ["endpoints", "service", "repository", "worker"])
def test_every_role_that_a_contract_names_exists(role: str) -> None:
    """A pattern that matches no file would never be violated."""
    named = {
        module
        for contract in CONTRACTS.values()
        for module in contract.get("source_modules", []) + contract.get("forbidden_modules", [])
    }

    assert f"app.*.{role}" in named
    assert list(ROOT.glob(f"app/*/{role}.py"))


@pytest.mark.parametrize(
    ("file", "line", "contract"),
    [
        ("identification/errors.py", "import identification.pipeline", "layers"),
        ("identification/model/declared.py", "import identification.effects", "layers"),
        ("identification/effects/friction.py", "import identification.fit.solve", "layers"),
        ("identification/effects/friction.py", "import identification.work", "laws"),
        ("identification/surrogates/curve.py", "import identification.ingest", "surrogates"),
        ("identification/result/entries.py", "import identification.reporting.svg", "layers"),
        ("identification/reporting/svg.py", "import identification.fit.solve", "report"),
        ("identification/reporting/svg.py", "import scipy.stats", "report"),
        ("identification/quantities.py", "import fastapi", "library"),
        ("app/fits/endpoints.py", "import app.fits.repository", "endpoints"),
        ("app/fits/service.py", "import fastapi", "services"),
        ("app/storage.py", "import app.fits.service", "application"),
        ("app/runs/service.py", "import app.runs.endpoints", "application"),
        ("bench/motors.py", "import identification.quantities", "bench"),
        ("motorid/files.py", "import identification.quantities", "client"),
    ],
)
def test_an_upward_import_is_refused(sources: Path, file: str, line: str, contract: str) -> None:
    """Negative control: import-linter reports exactly the violated contract."""
    spoiled = sources / file
    text = spoiled.read_text(encoding="utf-8")
    start = "from __future__ import annotations\n"
    assert start in text
    spoiled.write_text(text.replace(start, f"{start}\n{line}\n", 1), encoding="utf-8")

    finished = lint_imports(sources)

    name = CONTRACTS[contract]["name"]
    assert finished.returncode == 1, finished.stdout + finished.stderr
    assert f"{name} BROKEN" in finished.stdout


def test_no_import_points_upwards(sources: Path) -> None:
    """All contracts hold, and import-linter has checked each of them."""
    finished = lint_imports(sources)

    assert finished.returncode == 0, finished.stdout + finished.stderr
    assert f"Contracts: {len(CONTRACTS)} kept, 0 broken." in finished.stdout


@pytest.mark.parametrize(
    ("module", "absent"),
    [
        ("identification", ("app", "fastapi", "sqlalchemy", "typer", "arviz", "matplotlib")),
        ("app.cli", ("fastapi", "starlette", "uvicorn", "sqlalchemy", "httpx")),
        ("motorid.client", ("app", "identification", "numpy", "pandas", "casadi", "pydantic")),
        # The first page of a result waits for this import; scipy.stats would double the time.
        ("identification.reporting.tables", ("scipy.stats", "pandas", "casadi", "numba")),
    ],
)
def test_each_package_loads_only_its_own_dependencies(module: str, absent: tuple[str, ...]) -> None:
    """Decision 0004: `motorid fit` needs no web framework; tested in a new interpreter."""
    program = f"import sys, {module}; print(*[n for n in {absent!r} if n in sys.modules])"

    loaded = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()

    assert loaded == []
