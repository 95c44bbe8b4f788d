"""The files of docs/deploy/ are valid, use existing settings, and restrict privileges."""

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
    """Content of a compose file."""
    return dict(yaml.safe_load((FOLDER / name).read_text(encoding="utf-8")))


def objects(kind: str) -> list[dict[str, Any]]:
    """Objects of one kind in the Kubernetes example."""
    text = (FOLDER / "kubernetes.yaml").read_text(encoding="utf-8")
    return [found for found in yaml.safe_load_all(text) if found["kind"] == kind]


def pods() -> list[dict[str, Any]]:
    """Specifications of all pods."""
    return [found["spec"]["template"]["spec"] for found in objects("Deployment")]


def commands() -> list[list[str]]:
    """Command lines that start Dask in a container."""
    services = compose("dask.yaml")["services"].values()
    found = [service.get("command", []) for service in services]
    found += [pod["containers"][0].get("args", []) for pod in pods()]
    return [words for words in found if words]


def test_every_file_of_the_folder_is_tested_here() -> None:
    """A new file must be added to these tests."""
    assert {path.name for path in FOLDER.iterdir()} == {*COMPOSE, "kubernetes.yaml"}


def test_page_links_every_file() -> None:
    """docs/deploy.md has a link to each file."""
    page = (ROOT / "docs" / "deploy.md").read_text(encoding="utf-8")

    for path in FOLDER.iterdir():
        assert f"(deploy/{path.name})" in page


@pytest.mark.parametrize("name", COMPOSE)
def test_compose_file_is_consistent_and_restricted(name: str) -> None:
    """Secrets and volumes are declared, variables are settings, and privileges are dropped."""
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
def test_dask_is_started_with_valid_options_and_certificates(words: list[str]) -> None:
    """Reference: the options of Dask's programs; no memory limit of a worker may kill a fit."""
    program = {"scheduler": dask_scheduler.main, "worker": dask_worker.main}[words[1]]
    known = {name for parameter in program.params for name in parameter.opts}
    known |= {name for parameter in program.params for name in parameter.secondary_opts}
    given = {word.split("=")[0] for word in words if word.startswith("--")}

    assert words[0] == "dask"
    assert given <= known
    assert {"--tls-ca-file", "--tls-cert", "--tls-key"} <= given
    assert not [word for word in words if word.startswith("tcp://")]
    assert words[1] == "scheduler" or "--memory-limit=0" in words


def test_pods_have_restricted_privileges_and_probes() -> None:
    """No root user, no capabilities, read-only root, probes, and a memory limit."""
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


def test_pods_refer_to_existing_objects() -> None:
    """Volumes, claims, secrets and settings exist."""
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


def test_secrets_have_the_names_of_their_settings() -> None:
    """The service looks up a secret by the name of its setting."""
    [settings] = [s for s in objects("Secret") if s["metadata"]["name"] == "motorid-settings"]
    names = {name.upper() for name in settings["stringData"]}

    assert names <= VARIABLES
    assert "motorid_database_url" in compose("postgresql.yaml")["secrets"]
