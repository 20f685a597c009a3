"""Progress messages and readable sizes, for plugins."""

from robovast.base.progress_bar import ProgressBar, fmt_size

__all__ = ["ProgressBar", "fmt_size"]
