"""The base class of shares, for plugins."""

from robovast.storage.shares.base import BaseShareProvider, UploadProgressReader

__all__ = ["BaseShareProvider", "UploadProgressReader"]
