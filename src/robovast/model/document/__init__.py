"""The .vast document: its model, its loader with places in the file, its checks, its schema."""

from robovast.model.document.loader import Document, load_document
from robovast.model.document.model import Vast

__all__ = ["Document", "Vast", "load_document"]
