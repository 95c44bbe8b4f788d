"""What docs/deploy/ holds can be read, says only what the service knows, and is locked down."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from distributed.cli import dask_scheduler, dask_worker

from app.settings import Settings

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "deploy"
COMPOSE = ("postgresql.yaml", "dask.yaml")
VARIABLES = {f"MOTORID_{name.upper()}" for name in Settings.model_fields} | {"MOTORID_SECRETS_DIR"}


def compose(name: str) -> dict[str, Any]:
    """A compose file."""
    return dict(yaml.safe_load((FOLDER / name).read_text(encoding="utf-8")))


def objects(kind: str) -> list[dict[str, Any]]:
    """Objects of a kind in the Kubernetes example."""
    text = (FOLDER / "kubernetes.yaml").read_text(encoding="utf-8")
    return [found for found in yaml.safe_load_all(text) if found["kind"] == kind]


def pods() -> list[dict[str, Any]]:
    """Specifications of all pods."""
    return [found["spec"]["template"]["spec"] for found in objects("Deployment")]


def commands() -> list[list[str]]:
    """Words by which containers start Dask."""
    services = compose("dask.yaml")["services"].values()
    found = [service.get("command", []) for service in services]
    found += [pod["containers"][0].get("args", []) for pod in pods()]
    return [words for words in found if words]


def test_folder_holds_what_is_tested_here() -> None:
    """Another file would go unread."""
    assert {path.name for path in FOLDER.iterdir()} == {*COMPOSE, "kubernetes.yaml"}


def test_page_names_every_file() -> None:
    """By a link that leads there."""
    page = (ROOT / "docs" / "deploy.md").read_text(encoding="utf-8")

    for path in FOLDER.iterdir():
        assert f"(deploy/{path.name})" in page


@pytest.mark.parametrize("name", COMPOSE)
def test_compose_file_knows_what_it_names(name: str) -> None:
    """Secrets and volumes are declared, variables are settings, and ours are locked down."""
    file = compose(name)
    for service in file["services"].values():
        assert set(service.get("secrets", [])) <= set(file["secrets"])
        named = {volume.split(":")[0] for volume in service.get("volumes", [])}
        assert named <= set(file["volumes"])
        assert service["restart"] == "unless-stopped"
        assert "no-new-privileges:true" in service["security_opt"]
        if service["image"] == "motorid":
            assert set(service.get("environment", {})) <= VARIABLES
            assert service["read_only"]
            assert service["cap_drop"] == ["ALL"]


@pytest.mark.parametrize("words", commands(), ids=lambda words: words[1])
def test_dask_is_started_with_options_that_it_has_and_with_certificates(words: list[str]) -> None:
    """Against the options of its own programs; a worker has no limit that would kill fits."""
    program = {"scheduler": dask_scheduler.main, "worker": dask_worker.main}[words[1]]
    known = {name for parameter in program.params for name in parameter.opts}
    known |= {name for parameter in program.params for name in parameter.secondary_opts}
    given = {word.split("=")[0] for word in words if word.startswith("--")}

    assert words[0] == "dask"
    assert given <= known
    assert {"--tls-ca-file", "--tls-cert", "--tls-key"} <= given
    assert not [word for word in words if word.startswith("tcp://")]
    assert words[1] == "scheduler" or "--memory-limit=0" in words


def test_pods_are_locked_down_and_watched() -> None:
    """Not root, no capability, read-only root, probes, and a limit of memory."""
    assert len(pods()) == 3
    for pod in pods():
        [container] = pod["containers"]
        assert pod["securityContext"]["runAsNonRoot"]
        assert pod["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
        assert not pod["automountServiceAccountToken"]
        assert not pod["enableServiceLinks"]
        assert container["securityContext"] == {
            "allowPrivilegeEscalation": False,
            "readOnlyRootFilesystem": True,
            "capabilities": {"drop": ["ALL"]},
        }
        assert {"startupProbe", "livenessProbe", "readinessProbe"} <= set(container)
        assert "memory" in container["resources"]["limits"]


def test_pods_name_what_is_there() -> None:
    """Volumes, claims, secrets and settings."""
    secrets = {found["metadata"]["name"] for found in objects("Secret")}
    claims = {found["metadata"]["name"] for found in objects("PersistentVolumeClaim")}
    for pod in pods():
        [container] = pod["containers"]
        volumes = {volume["name"] for volume in pod["volumes"]}
        assert {mount["name"] for mount in container["volumeMounts"]} == volumes
        for volume in pod["volumes"]:
            if "secret" in volume:
                assert volume["secret"]["secretName"] in secrets
            if "persistentVolumeClaim" in volume:
                assert volume["persistentVolumeClaim"]["claimName"] in claims
        assert {variable["name"] for variable in container.get("env", [])} <= VARIABLES


def test_secret_that_a_file_hands_in_is_called_as_its_variable() -> None:
    """The name by which the service looks for it."""
    [settings] = [s for s in objects("Secret") if s["metadata"]["name"] == "motorid-settings"]
    names = {name.upper() for name in settings["stringData"]}

    assert names <= VARIABLES
    assert "motorid_database_url" in compose("postgresql.yaml")["secrets"]
