"""API keys and browser sessions."""

from __future__ import annotations

import time

import pytest

from app.access.service import AccessService
from app.database import Database
from app.errors import BadKey
from identification.errors import OptionError


@pytest.fixture
def access(database: Database) -> AccessService:
    """Access service on an empty database."""
    return AccessService(database)


def test_key_gives_access_to_its_workspace(access: AccessService) -> None:
    """Authentication returns the workspace and the ID of the key."""
    key, secret = access.create_key("bench 4", "motors")

    caller = access.caller_of_key(secret)

    assert (caller.workspace, caller.key_id) == ("motors", key.id)


def test_key_is_that_of_an_owner_unless_it_says_otherwise(access: AccessService) -> None:
    """The session of a key has the same right as the key."""
    made = ((True, access.create_key("a")), (False, access.create_key("b", owner=False)))

    for owner, (key, secret) in made:
        assert key.owner is owner
        assert access.caller_of_key(secret).is_owner is owner
        token = access.open_session(secret, 60.0)
        assert access.caller_of_session(token).is_owner is owner


def test_revoked_key_is_invalid_and_ends_its_sessions(access: AccessService) -> None:
    """Other keys remain valid; a second revocation is rejected."""
    key, secret = access.create_key("lost")
    _, other = access.create_key("kept")
    token = access.open_session(secret, 60.0)
    assert access.caller_of_session(token).key_id == key.id

    access.revoke_key(key.id)

    with pytest.raises(BadKey, match="not valid"):
        access.caller_of_key(secret)
    with pytest.raises(BadKey, match="has ended"):
        access.caller_of_session(token)
    with pytest.raises(BadKey, match="not valid"):
        access.open_session(secret, 60.0)
    assert access.caller_of_key(other).workspace == "default"
    with pytest.raises(OptionError, match="can be revoked"):
        access.revoke_key(key.id)


def test_session_ends_by_expiry_and_by_logout(access: AccessService) -> None:
    """Expired, closed and malformed session tokens are rejected."""
    _, secret = access.create_key("bench")
    over = access.open_session(secret, -1.0)
    closed = access.open_session(secret, 60.0)
    access.close_session(closed)

    for token in (over, closed, "", "x" * 10_000, "\udcff"):
        with pytest.raises(BadKey, match="has ended"):
            access.caller_of_session(token)


def test_list_includes_revoked_keys(access: AccessService) -> None:
    """Keys are listed in order of creation, with the time of revocation."""
    made = [access.create_key(name)[0] for name in ("a", "b", "c")]
    before = time.time()
    access.revoke_key(made[1].id)

    listed = access.list_keys()

    assert [key.name for key in listed] == ["a", "b", "c"]
    assert [key.revoked_at is None for key in listed] == [True, False, True]
    revoked_at = listed[1].revoked_at
    assert revoked_at is not None
    assert before <= revoked_at <= time.time()


def test_secrets_are_long_and_different(access: AccessService) -> None:
    """A key has 256 random bits, which are 43 characters of base64."""
    secrets = {access.create_key("k")[1] for _ in range(20)}

    assert len(secrets) == 20
    assert all(len(secret) >= len("motorid_") + 43 for secret in secrets)


@pytest.mark.parametrize("secret", ["", "motorid_", "x" * 10_000, "' OR '1'='1", "\x00", "\udcff"])
def test_invalid_key_is_refused(access: AccessService, secret: str) -> None:
    """This includes very long keys and keys that UTF-8 cannot encode."""
    access.create_key("bench")

    with pytest.raises(BadKey, match="not valid"):
        access.caller_of_key(secret)


@pytest.mark.parametrize("workspace", ["", "A", "a b", "../x", "a" * 64, "-a", "ä"])
def test_invalid_workspace_name_is_refused(access: AccessService, workspace: str) -> None:
    """A workspace name has lower-case letters, digits, - and _."""
    with pytest.raises(OptionError, match="workspace is"):
        access.create_key("bench", workspace)


@pytest.mark.parametrize("name", ["", "x" * 201, "a\nb", "a\x00"])
def test_invalid_key_name_is_refused(access: AccessService, name: str) -> None:
    """The list shows one key per line, so names must be printable and short."""
    with pytest.raises(OptionError, match="1 to 200 printable"):
        access.create_key(name)


def test_key_is_valid_until_it_expires(
    access: AccessService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The sessions of a key expire with it."""
    key, secret = access.create_key("visitor", days=2.0)
    token = access.open_session(secret, 10 * 86_400.0)
    made = key.created_at

    monkeypatch.setattr(time, "time", lambda: made + 86_400.0)
    assert access.caller_of_key(secret).key_id == key.id
    assert access.caller_of_session(token).key_id == key.id

    monkeypatch.setattr(time, "time", lambda: made + 3 * 86_400.0)
    with pytest.raises(BadKey, match="not valid"):
        access.caller_of_key(secret)
    with pytest.raises(BadKey, match="has ended"):
        access.caller_of_session(token)


@pytest.mark.parametrize("days", [0.0, -1.0, float("nan"), float("inf"), 1e9])
def test_invalid_expiry_is_refused(access: AccessService, days: float) -> None:
    """The number of days must be positive and at most a century."""
    with pytest.raises(OptionError, match="^days is"):
        access.create_key("bench", days=days)
