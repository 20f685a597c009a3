"""Caches files that are expensive to make, by a hash of their inputs."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import NamedTemporaryFile

from robovast.base.atomic import appearing_file
from robovast.base.safe_paths import MOST_OF_ALL, read_file


class ContentCache:
    """A folder of files by key; entries appear complete or not at all.

    Args:
        cache_dir: the folder; created if necessary. Default: `robovast` in the user's cache.
        name: a subfolder that separates different users of the cache.
    """

    def __init__(self, cache_dir: str | Path | None = None, name: str = "files") -> None:
        base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        self._folder = (Path(cache_dir) if cache_dir else Path(base) / "robovast") / name

    def key(self, files: Iterable[str | Path], *values: object) -> str:
        """A hash of the content of files and of further values; paths do not matter."""
        digest = hashlib.sha256()
        for file in files:
            with Path(file).open("rb") as content:
                digest.update(hashlib.file_digest(content, "sha256").digest())
        digest.update(repr(values).encode())
        return digest.hexdigest()

    def get(self, key: str) -> Path | None:
        """The file stored under a key, or None."""
        path = self._folder / key
        return path if path.is_file() else None

    def put(self, key: str, file: str | Path) -> Path:
        """Store a copy of a file under a key."""
        with appearing_file(self._folder / key) as part:
            shutil.copyfile(file, part)
        return self._folder / key


class FileCache:
    """Caches files of a plugin beside its data, by the content of their inputs.

    Args:
        data_directory: files are stored in its subfolder `.cache`.
        cache_file_prefix: prefix of the file names.
        file_name_hash_objects: further values that are hashed as text.
        cache_file_suffix: suffix of the file names.
    """

    def __init__(
        self,
        data_directory: str | Path,
        cache_file_prefix: str,
        file_name_hash_objects: Sequence[object],
        cache_file_suffix: str = "",
    ) -> None:
        self._cache = ContentCache(data_directory, ".cache")
        self._prefix, self._suffix = cache_file_prefix, cache_file_suffix
        self._values = tuple(map(str, file_name_hash_objects))

    def get_cached_file(
        self,
        input_files: Iterable[str | Path],
        binary: bool = False,
        content: bool = True,
        strings_for_hash: Sequence[str] | None = None,
    ) -> str | bytes | Path | None:
        """The file made from the same inputs, or None.

        Args:
            input_files: files whose content is hashed.
            binary: return bytes in place of text.
            content: return the content in place of the cached file's path.
            strings_for_hash: further text that is hashed.
        """
        path = self._cache.get(self._name(input_files, strings_for_hash))
        if path is None or not content:
            return path
        found = read_file(path, most=MOST_OF_ALL)
        return found if binary else found.decode()

    def save_file_to_cache(
        self,
        input_files: Iterable[str | Path],
        file_content: str | bytes,
        binary: bool = False,
        content: bool = True,
        strings_for_hash: Sequence[str] | None = None,
    ) -> Path:
        """Store a file made from input files; return the stored file's path.

        Args:
            input_files: files whose content is hashed.
            file_content: the content; with `content=False`, the path of a file to copy.
            binary: has no effect; bytes and text are distinguished by their type.
            content: see `file_content`.
            strings_for_hash: further text that decides.
        """
        del binary
        name = self._name(input_files, strings_for_hash)
        if not content:
            return self._cache.put(name, Path(os.fsdecode(file_content)))
        data = file_content.encode() if isinstance(file_content, str) else bytes(file_content)
        with NamedTemporaryFile() as file:
            file.write(data)
            file.flush()
            return self._cache.put(name, file.name)

    def _name(self, files: Iterable[str | Path], strings: Sequence[str] | None) -> str:
        key = self._cache.key(files, *self._values, *(strings or ()))
        return f"{self._prefix}{key}{self._suffix}"
