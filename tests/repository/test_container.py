"""Consistency of Dockerfile, docs/deploy/, settings and health check."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from app.health import probe
from app.health.endpoints import router
from app.settings import Settings

ROOT = Path(__file__).parents[2]
LINES = (ROOT / "Dockerfile").read_text(encoding="utf-8").replace("\\\n", " ").splitlines()
DOCKER_STOP_S = 10.0  # default grace period of `docker stop`


def words_of(instruction: str) -> list[str]:
    """Arguments of the last instruction of a name."""
    found = [line for line in LINES if line.startswith(f"{instruction} ")]
    return shlex.split(found[-1])[1:]


def variables() -> dict[str, str]:
    """Environment of the image."""
    return dict(word.split("=", 1) for word in words_of("ENV"))


def settings() -> Settings:
    """Settings of the service in the environment of the image, whose documentation is not here."""
    given = {
        name.removeprefix("MOTORID_").lower(): value
        for name, value in variables().items()
        if name.startswith("MOTORID_") and name != "MOTORID_HELP_DIR"
    }
    assert set(given) <= set(Settings.model_fields)
    return Settings.model_validate(given)


def services() -> list[dict[str, Any]]:
    """The service in each compose file."""
    files = sorted((ROOT / "docs" / "deploy").glob("*.yaml"))
    loaded = [yaml.safe_load(p.read_text("utf-8")) for p in files if p.stem != "kubernetes"]
    return [file["services"]["motorid"] for file in loaded]


def pods() -> list[dict[str, Any]]:
    """Pods of the Kubernetes example; the first is that of the service."""
    text = (ROOT / "docs" / "deploy" / "kubernetes.yaml").read_text(encoding="utf-8")
    kinds = [found for found in yaml.safe_load_all(text) if found["kind"] == "Deployment"]
    return [found["spec"]["template"]["spec"] for found in kinds]


def test_port_is_the_same_everywhere() -> None:
    """Settings, EXPOSE and the forwarded ports of all examples agree."""
    port = settings().port

    assert settings().host == "0.0.0.0"
    assert words_of("EXPOSE") == [str(port)]
    assert {line.split(":")[-1] for s in services() for line in s["ports"]} == {str(port)}
    assert pods()[0]["containers"][0]["ports"] == [{"name": "http", "containerPort": port}]


def test_command_leaves_address_and_port_to_the_settings() -> None:
    """A command-line argument would override MOTORID_PORT."""
    assert words_of("CMD") == ["[motorid,", "serve]"]
    assert words_of("ENTRYPOINT")[0] == "[/usr/bin/tini,"


def test_user_is_the_same_everywhere() -> None:
    """USER, the owner of /data, the pods and the page agree."""
    [given] = words_of("USER")
    user, group = given.split(":")
    owned = f"--owner {user} --group {group} --mode 0700 /data"

    assert any(owned in line for line in LINES)
    for pod in pods():
        context = pod["securityContext"]
        assert (context["runAsUser"], context["runAsGroup"]) == (int(user), int(group))
        assert context["fsGroup"] == int(group)
    assert f"user {user}" in (ROOT / "docs" / "deploy.md").read_text(encoding="utf-8")


def test_health_check_requests_readiness_on_the_configured_port() -> None:
    """The command runs `app.health.probe`, and the service answers its path."""
    check = " ".join(words_of("HEALTHCHECK"))
    paths = {getattr(route, "path", None) for route in router.routes}

    assert check.endswith("CMD [python, -P, -m, app.health.probe]")
    assert probe.PATH == "/readyz"
    assert probe.PATH in paths
    assert probe.address({"MOTORID_HOST": "0.0.0.0", "MOTORID_PORT": "9000"}) == (
        "127.0.0.1",
        "9000",
    )
    assert probe.address({}) == ("127.0.0.1", str(Settings.model_fields["port"].default))
    http = {
        kind: pods()[0]["containers"][0][f"{kind}Probe"]["httpGet"]
        for kind in ("startup", "liveness", "readiness")
    }
    assert http["readiness"]["path"] == probe.PATH
    assert {found["path"] for found in http.values()} <= paths
    # MOTORID_ALLOWED_HOSTS always permits localhost, but may refuse the address of a pod.
    assert [found["httpHeaders"] for found in http.values()] == [
        [{"name": "Host", "value": "localhost"}]
    ] * 3


def test_requests_have_ended_before_anything_kills_the_service() -> None:
    """The shutdown takes at most half the grace period of `docker stop`; examples allow more."""
    most = settings().shutdown_s

    assert most <= DOCKER_STOP_S / 2
    assert all(float(s["stop_grace_period"].rstrip("s")) >= DOCKER_STOP_S for s in services())
    assert all(pod["terminationGracePeriodSeconds"] >= DOCKER_STOP_S for pod in pods())


def test_all_written_directories_are_on_the_volume() -> None:
    """The root file system may then be read-only."""
    [volume] = words_of("VOLUME")

    assert {variables()[name] for name in ("MOTORID_DATA_DIR", "HOME", "TMPDIR")} == {volume}
    assert all(s["volumes"] == [f"data:{volume}"] for s in services())


def test_build_context_contains_only_the_copied_sources() -> None:
    """.dockerignore excludes everything except the sources of COPY, which it names."""
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    copied = [line.split()[1:-1] for line in LINES if line.startswith("COPY ")]
    sources = {word for words in copied for word in words if "--from=" not in " ".join(words)}

    assert ignored[1] == "*"
    assert {line[1:] for line in ignored if line.startswith("!")} == sources


def test_image_has_the_documentation_and_not_its_tools() -> None:
    """The last stage takes the directory of the site and nothing else of that stage."""
    [built] = [line for line in LINES if "mkdocs build" in line]
    taken = [line.split()[1:] for line in LINES if line.startswith("COPY --from=site")]
    directory = variables()["MOTORID_HELP_DIR"]

    assert taken == [["--from=site", directory, directory]]
    assert shlex.split(built)[-2:] == ["--site-dir", directory]
    assert "--strict" in built
    # The generated references state the version, which only an installed package has.
    assert built.startswith("RUN pip install --no-deps wheel/*.whl")


@pytest.mark.skipif(shutil.which("make") is None, reason="needs make")
@pytest.mark.parametrize(("told", "is_taken"), [("sha256:" + 64 * "e", True), ("oops", False)])
def test_base_is_updated_to_the_digest_of_the_registry(
    tmp_path: Path, told: str, is_taken: bool
) -> None:
    """A substitute engine answers; text that is no digest leaves the Dockerfile unchanged."""
    for name in ("Makefile", "Dockerfile"):
        shutil.copy(ROOT / name, tmp_path)
    engine = tmp_path / "engine"
    engine.write_text(f"#!/bin/sh\necho {told}\n", encoding="utf-8")
    engine.chmod(0o755)

    words = ["make", "image-base", f"ENGINE={engine}", "PYTHON=false"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)

    before = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    after = (tmp_path / "Dockerfile").read_text(encoding="utf-8")
    assert (done.returncode == 0) is is_taken
    assert after == (re.sub(r"@sha256:\w+", f"@{told}", before) if is_taken else before)
