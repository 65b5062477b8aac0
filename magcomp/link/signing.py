"""MAVLink 2 signing: the key file, and the check of what arrives.

The digest is the beginning of SHA-256 over the key and what the signature covers.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import stat
from pathlib import Path

from magcomp.errors import InputError
from magcomp.mavlink.header import is_signed, signature, source

KEY_LENGTH = 32
_EPOCH_2015_US = 1_420_070_400_000_000
_UNIT_US = 10
_MINUTE = 60 * 1_000_000 // _UNIT_US
_LONGEST_FILE = 4096


def read_signing_key(path: Path) -> bytes:
    """Read a signing key.

    A file of exactly 32 bytes is the key itself. Any other is a passphrase in
    UTF-8; the key is its SHA-256, as ground stations make it. White space
    around a passphrase does not count.

    Raises
    ------
    InputError
        The file cannot be read, is empty, too long, or is no text.
    """
    try:
        with path.open("rb") as file:
            content = file.read(_LONGEST_FILE + 1)
    except OSError as error:
        raise InputError(
            f"The signing key {path} must be a readable file: {error.strerror}."
        ) from error
    if len(content) == KEY_LENGTH:
        return content
    try:
        passphrase = content.decode().strip()
    except UnicodeDecodeError as error:
        raise InputError(
            f"The signing key {path} must be 32 bytes or a passphrase; "
            f"instead received {len(content)} bytes that are no text."
        ) from error
    if not passphrase or len(content) > _LONGEST_FILE:
        raise InputError(
            f"The signing key {path} must be 32 bytes or a passphrase; "
            f"instead received {'nothing' if not passphrase else 'more than 4096 bytes'}."
        )
    return hashlib.sha256(passphrase.encode()).digest()


def is_read_by_others(path: Path) -> bool:
    """Whether other users of this computer may read a file, where the system tells."""
    try:
        return os.name != "nt" and bool(path.stat().st_mode & (stat.S_IRGRP | stat.S_IROTH))
    except OSError:
        return False


def signing_timestamp(unix_us: int) -> int:
    """Turn calendar time into a signature's units."""
    return max(0, unix_us - _EPOCH_2015_US) // _UNIT_US


class SignatureCheck:
    """Decides which frames carry the key's signature and are not replayed.

    Timestamps must grow in each stream (link, system, component); the first of a
    stream may be at most a minute older than the newest time known here.

    Attributes
    ----------
    newest
        The latest time proven on this link, in signature units. What is sent must not be older.
    """

    def __init__(self, key: bytes, unix_us: int) -> None:
        self._key = key
        self._streams: dict[tuple[int, int, int], int] = {}
        self.newest = signing_timestamp(unix_us)

    def accepts(self, frame: bytes) -> bool:
        """Check one whole frame, and remember its time where it is genuine."""
        if not is_signed(frame):
            return False
        # The signature comes first: a forger must not be able to move a stream's time.
        signed = signature(frame)
        digest = hashlib.sha256(self._key + signed.covered).digest()[: len(signed.digest)]
        if not hmac.compare_digest(digest, signed.digest):
            return False
        timestamp = signed.time
        stream = (signed.link, *source(frame))
        oldest = self._streams.get(stream, self.newest - _MINUTE - 1)
        if timestamp <= oldest:
            return False
        self._streams[stream] = timestamp
        self.newest = max(self.newest, timestamp)
        return True
