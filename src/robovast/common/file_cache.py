"""Files that cost much to make, for plugins."""

from robovast.base.file_cache import FileCache

__all__ = ["FileCache"]
