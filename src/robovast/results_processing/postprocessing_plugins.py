"""The base class of postprocessing commands, where plugins look for it."""

from robovast.compat.postprocessing import BasePostprocessingPlugin

__all__ = ["BasePostprocessingPlugin"]
