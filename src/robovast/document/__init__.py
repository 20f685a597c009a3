"""The .vast document: its model, its loader with places in the file, its checks, its schema."""

from robovast.document.loader import Document, load_document
from robovast.document.model import Vast

__all__ = ["Document", "Vast", "load_document"]
