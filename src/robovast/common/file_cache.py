"""A cache of files that are expensive to make, for plugins."""

from robovast.base.file_cache import FileCache

__all__ = ["FileCache"]
